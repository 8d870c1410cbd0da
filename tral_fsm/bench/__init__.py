"""How fast things are: measurements that `tral bench` and the scripts of benchmarks/ share."""
