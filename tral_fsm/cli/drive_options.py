"""Options of `tral drive`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tral_env.errors import ConfigError
from tral_fsm.evaluation import choices

Scenario = Annotated[str, typer.Option(help="Family of courses; `tral courses` lists them.")]
Seed = Annotated[int, typer.Option(min=0, help="Seed of the first episode; each later episode has the next seed.")]
Episodes = Annotated[int, typer.Option(min=1, help="Number of episodes.")]
Policy = Annotated[
    str,
    typer.Option(
        help="Name of a packaged machine or trained policy, a machine file, the folder of a trained policy, or "
        "FILE.py:NAME for a policy of your own."
    ),
]
Camera = Annotated[
    choices.Camera,
    typer.Option(
        help="Project the markers, as gym.make does by default, or render the camera's image: slower, needs OpenGL."
    ),
]
Randomized = Annotated[
    str,
    typer.Option(help="How much cars and sensors differ from seed to seed: none, default, hard, or a file of ranges."),
]
Car = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME=VALUE", help="A parameter of the car that is not drawn: friction=0.6. Repeatable."),
]
Out = Annotated[Path, typer.Option(file_okay=False, help="Folder of the files; it replaces those of an earlier drive.")]
Course = Annotated[
    str | None,
    typer.Option(help="Drive one course instead of a family: a name that `tral courses` lists, or a course file."),
]
Video = Annotated[bool, typer.Option(help="Write drive.mp4, which needs OpenGL.")]
Lens = Annotated[
    str, typer.Option(help="Lens of the camera: default, wide, or a camera_info file of `tral calibrate`.")
]
Trace = Annotated[bool, typer.Option("--trace", help="Write trace.csv: each tick, and why each transition fired.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print summary.json and nothing else; the files are written too.")]


def car_parameters(given: list[str]) -> dict[str, float]:
    """Parameters of the car, from texts NAME=VALUE.

    Raises:
        ConfigError: a text has another form, or the car has no such parameter or may not have this value.
    """
    from tral_env.randomization import LEVELS

    values: dict[str, float] = {}
    for text in given:
        name, _, number = (part.strip() for part in text.partition("="))
        if name in values:
            raise ConfigError(f"--car {text}: {name} is set twice")
        try:
            values[name] = float(number)
            LEVELS["none"].fixed(**{name: values[name]})
        except ConfigError as error:
            raise ConfigError(f"--car {text}: {error}") from error
        except ValueError:
            raise ConfigError(f"--car {text}: expected NAME=VALUE with a number, such as friction=0.6") from None
    return values
