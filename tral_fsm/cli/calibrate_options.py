"""Options of `tral calibrate` beside those of its board."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Sources = Annotated[
    list[str] | None,
    typer.Argument(help="Images, folders, patterns, videos, or a camera such as /dev/video0.", show_default=False),
]
Simulated = Annotated[bool, typer.Option("--simulated", help="Look at a board that moves before the simulated camera.")]
Lens = Annotated[str, typer.Option(help="Lens of the simulated camera: default, wide, or a camera_info file.")]
Shots = Annotated[int, typer.Option(min=1, help="Number of images of the simulated camera.")]
Seed = Annotated[int, typer.Option(min=0, help="Seed of the simulated board's poses.")]
Every = Annotated[int, typer.Option(min=1, help="Of a video or a camera, look at one in this many frames.")]
MaxViews = Annotated[int, typer.Option(min=4, help="Stop after this many usable views.")]
Radial = Annotated[
    int, typer.Option(min=1, max=3, help="Number of radial distortion terms; 3 for lenses wider than 100 degrees.")
]
Name = Annotated[str, typer.Option(help="Name of the camera in the file.")]
KeepImages = Annotated[bool, typer.Option("--keep-images", help="Save every image that was looked at.")]
Out = Annotated[Path, typer.Option(file_okay=False, help="Folder of the files.")]
AsJson = Annotated[
    bool, typer.Option("--json", help="Print calibration.json and nothing else; the files are written too.")
]
