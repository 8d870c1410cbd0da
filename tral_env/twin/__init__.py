"""The twin: the simulated car behind files that behave as the devices of the real car do.

`pca9685`, `srf08`, `bus` and `receivers` are pure models whose clock is an argument. `car` is the simulated car: it
hears commands and answers rangings. `devices` and `device_files` show the boards as files. `twin` runs all of it in
real time.
"""
