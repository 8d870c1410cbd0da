"""Recordings as a LeRobotDataset v3.0: Parquet, MP4, metadata. Each episode has files of its own.

Source of the format: the repository huggingface/lerobot, `lerobot/datasets` (codebase version v3.0).
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_env.errors import BadFileError, ConfigError, MissingExtraError
from tral_env.interface import CONTROL_PERIOD_S, CONTROL_RATE_HZ
from tral_env.recording.read import Recording
from tral_env.recording.video import VideoWriter

Stats = dict[str, dict[str, Any]]
Image = NDArray[np.uint8]

VERSION = "v3.0"
FPS = int(CONTROL_RATE_HZ)
VIDEO = "observation.images.camera"
"""Name of the feature that holds the images."""
_STATE, _ACTION = "observation.state", "action"
_CHUNK = 1000
"""A folder holds so many files. Source: DEFAULT_CHUNK_SIZE."""
_FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}"
_DATA_PATH = f"data/{_FILE}.parquet"
_VIDEO_PATH = f"videos/{{video_key}}/{_FILE}.mp4"
_COUNTED: Mapping[str, str] = {
    "timestamp": "float32",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
}
"""Features that every dataset has, with their types. Source: DEFAULT_FEATURES."""
_STATS_EVERY = 16
"""Every so many images are looked at for their mean and spread."""


def write_dataset(recordings: Sequence[Recording], folder: Path, task: str = "") -> None:
    """Write recordings as the episodes of a dataset.

    A frame is a tick: what the policy was told, its answer, and the last image that was exposed before. A tick that was
    dropped has no frame.

    Args:
        recordings: one for each episode; all with the same readings, all with images or none.
        folder: folder of the dataset; it must not exist, or be empty.
        task: what the car was to do, in words; empty: from the recordings.

    Raises:
        MissingExtraError: pyarrow is not installed.
        ConfigError: the folder holds something, or there is no recording, or they do not fit together.
        BadFileError: a recording has no tick.
    """
    _pyarrow()
    _check(recordings, folder)
    tasks: dict[str, int] = {}
    rows: list[dict[str, Any]] = []
    stats: list[Stats] = []
    size = None
    for index, recording in enumerate(recordings):
        words = task or _task(recording)
        first = rows[-1]["dataset_to_index"] if rows else 0
        columns = _columns(recording, index, first, tasks.setdefault(words, len(tasks)))
        place = {"chunk_index": index // _CHUNK, "file_index": index % _CHUNK}
        _write_table(folder / _DATA_PATH.format(**place), columns)
        told, row = (
            {name: _stats(values) for name, values in columns.items()},
            _row(index, words, first, columns, place),
        )
        if next(recording.pictures(), None) is not None:
            size, told[VIDEO] = _write_video(recording, folder / _VIDEO_PATH.format(video_key=VIDEO, **place))
            seconds = {"from_timestamp": 0.0, "to_timestamp": row["length"] / FPS}
            row |= {f"videos/{VIDEO}/{name}": value for name, value in {**place, **seconds}.items()}
        rows.append(row)
        stats.append(told)
    _write_meta(folder, recordings[0], rows, stats, tasks, size)


def _row(
    index: int, task: str, first: int, columns: Mapping[str, NDArray[Any]], place: Mapping[str, int]
) -> dict[str, Any]:
    """What the table of the episodes tells of one."""
    frames = len(columns[_STATE])
    return {
        "episode_index": index,
        "tasks": [task],
        "length": frames,
        "dataset_from_index": first,
        "dataset_to_index": first + frames,
        **{f"data/{name}": value for name, value in place.items()},
        **{f"meta/episodes/{name}": 0 for name in place},
    }


def _pyarrow() -> Any:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise MissingExtraError("pyarrow", "lerobot", "a LeRobotDataset") from error
    return pyarrow


def _check(recordings: Sequence[Recording], folder: Path) -> None:
    if folder.exists() and any(folder.iterdir()):
        raise ConfigError(f"{folder}: the folder is not empty: choose another one, or remove it")
    if not recordings:
        raise ConfigError("a dataset of no recordings: expected one or more")
    first = recordings[0]
    images = next(first.pictures(), None) is not None
    for one in recordings:
        if not len(one.tick):
            raise BadFileError(f"{one.path}: the recording has no tick")
        if one.layout.names != first.layout.names or (next(one.pictures(), None) is not None) != images:
            raise ConfigError(f"{one.path} has other readings, or other images, than {first.path}: expected the same")


def _task(recording: Recording) -> str:
    name = recording.configuration.get("scenario", "")
    return f"drive through the corridor: {name}" if name else "drive through the corridor"


def _columns(recording: Recording, episode: int, first: int, task: int) -> dict[str, NDArray[Any]]:
    """Feature -> (T,) or (T, n)."""
    frames = np.arange(len(recording.tick))
    counted = {
        "timestamp": frames / FPS,
        "frame_index": frames,
        "episode_index": np.full(len(frames), episode),
        "index": first + frames,
        "task_index": np.full(len(frames), task),
    }
    return {
        _STATE: recording.observation,
        _ACTION: recording.action.astype(np.float32),
        **{name: counted[name].astype(kind) for name, kind in _COUNTED.items()},
    }


def _stats(values: NDArray[Any]) -> dict[str, Any]:
    """Figures of a feature, each a list with one number for each component."""
    rows = values.reshape(len(values), -1).astype(float)
    found = {"min": rows.min(0), "max": rows.max(0), "mean": rows.mean(0), "std": rows.std(0)}
    return {**{name: figure.tolist() for name, figure in found.items()}, "count": [len(rows)]}


def _write_table(path: Path, columns: Mapping[str, NDArray[Any]]) -> None:
    pa = _pyarrow()
    arrays = {}
    for name, values in columns.items():
        flat = pa.array(values.reshape(-1))
        arrays[name] = flat if values.ndim == 1 else pa.FixedSizeListArray.from_arrays(flat, values.shape[1])
    path.parent.mkdir(parents=True, exist_ok=True)
    pa.parquet.write_table(pa.table(arrays), path)


def _write_video(recording: Recording, path: Path) -> tuple[tuple[int, int], dict[str, Any]]:
    """Write a frame for each tick; gives height and width, px, and the figures of the colours."""
    path.parent.mkdir(parents=True, exist_ok=True)
    frames, looked = _frames(recording), []
    image = next(frames)
    height, width = image.shape[:2]
    # Two frames from key to key, as LeRobot has it: a frame in the middle is found fast.
    with VideoWriter(path, fps=FPS, quality=23, key_every=2) as video:
        for k in range(len(recording.tick)):
            video.add(image)
            if k % _STATS_EVERY == 0:
                looked.append(image[::4, ::4].reshape(-1, 3) / 255.0)
            image = next(frames, image)
    pixels = np.concatenate(looked)
    found = {"min": pixels.min(0), "max": pixels.max(0), "mean": pixels.mean(0), "std": pixels.std(0)}
    figures = {name: figure.reshape(3, 1, 1).tolist() for name, figure in found.items()}
    return (height, width), {**figures, "count": [len(looked)]}


def _frames(recording: Recording) -> Iterator[Image]:
    """RGB image of each tick: the last one that was exposed before the policy was asked, or else the first one."""
    pictures = recording.pictures()
    coming = next(pictures, None)
    assert coming is not None, "the caller has looked"
    image = coming.pixels()
    for time_s in (recording.time_s - CONTROL_PERIOD_S).tolist():
        while coming is not None and coming.time_s <= time_s:
            image, coming = coming.pixels(), next(pictures, None)
        yield image


def _write_meta(
    folder: Path,
    recording: Recording,
    rows: Sequence[Mapping[str, Any]],
    stats: Sequence[Stats],
    tasks: Mapping[str, int],
    size: tuple[int, int] | None,
) -> None:
    pa = _pyarrow()
    meta = folder / "meta"
    episodes = meta / "episodes" / (_FILE.format(chunk_index=0, file_index=0) + ".parquet")
    episodes.parent.mkdir(parents=True)
    told = [
        {**row, **{f"stats/{name}/{key}": value for name, found in one.items() for key, value in found.items()}}
        for row, one in zip(rows, stats, strict=True)
    ]
    pa.parquet.write_table(pa.Table.from_pylist(told), episodes)
    pa.parquet.write_table(_tasks_table(tasks), meta / "tasks.parquet")
    frames = sum(row["length"] for row in rows)
    info = {
        "codebase_version": VERSION,
        "robot_type": "tral",
        "total_episodes": len(rows),
        "total_frames": frames,
        "total_tasks": len(tasks),
        "chunks_size": _CHUNK,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 500,
        "fps": FPS,
        "splits": {"train": f"0:{len(rows)}"},
        "data_path": _DATA_PATH,
        "video_path": None if size is None else _VIDEO_PATH,
        "features": _features(recording, size),
    }
    (meta / "info.json").write_text(json.dumps(info, indent=4), encoding="utf-8")
    (meta / "stats.json").write_text(json.dumps(_pooled(stats), indent=4), encoding="utf-8")


def _tasks_table(tasks: Mapping[str, int]) -> Any:
    """The tasks as pandas writes a table whose index is the text of the task."""
    pa = _pyarrow()
    table = pa.table({"task_index": pa.array(tasks.values(), pa.int64()), "task": pa.array(tasks.keys(), pa.string())})
    column = {"field_name": "task_index", "metadata": None, "name": "task_index", "numpy_type": "int64"}
    index = {"field_name": "task", "metadata": None, "name": "task", "numpy_type": "object"}
    pandas = {
        "index_columns": ["task"],
        "column_indexes": [],
        "columns": [{**column, "pandas_type": "int64"}, {**index, "pandas_type": "unicode"}],
        "pandas_version": "2.2.0",
    }
    return table.replace_schema_metadata({"pandas": json.dumps(pandas)})


def _features(recording: Recording, size: tuple[int, int] | None) -> dict[str, Any]:
    names = list(recording.layout.names)
    features: dict[str, Any] = {
        _STATE: {"dtype": "float32", "shape": [len(names)], "names": names},
        _ACTION: {"dtype": "float32", "shape": [2], "names": ["steering", "throttle"]},
    }
    if size is not None:
        height, width = size
        info = {
            "video.height": height,
            "video.width": width,
            "video.codec": "h264",
            "video.pix_fmt": "yuv420p",
            "video.is_depth_map": False,
            "video.fps": FPS,
            "video.channels": 3,
            "has_audio": False,
        }
        shape, axes = [height, width, 3], ["height", "width", "channels"]
        features[VIDEO] = {"dtype": "video", "shape": shape, "names": axes, "info": info}
    return features | {name: {"dtype": kind, "shape": [1], "names": None} for name, kind in _COUNTED.items()}


def _pooled(stats: Sequence[Stats]) -> Stats:
    """Figures over all episodes from those of each."""
    pooled = {}
    for name in stats[0]:
        parts = {key: np.array([one[name][key] for one in stats], float) for key in stats[0][name]}
        weight = parts["count"].reshape(-1, *[1] * (parts["mean"].ndim - 1)) / parts["count"].sum()
        mean = (weight * parts["mean"]).sum(0)
        variance = (weight * (parts["std"] ** 2 + (parts["mean"] - mean) ** 2)).sum(0)
        pooled[name] = {
            "min": parts["min"].min(0).tolist(),
            "max": parts["max"].max(0).tolist(),
            "mean": mean.tolist(),
            "std": np.sqrt(variance).tolist(),
            "count": [int(parts["count"].sum())],
        }
    return pooled
