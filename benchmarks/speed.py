"""How fast is the environment? The same as `tral bench speed`.

python benchmarks/speed.py --out benchmarks/results
"""

import typer

from tral_fsm.cli.bench import speed

if __name__ == "__main__":
    typer.run(speed)
