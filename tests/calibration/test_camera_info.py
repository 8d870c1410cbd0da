"""Lenses by name and as camera_info files."""

from pathlib import Path

import cv2
import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from hypothesis import given
from hypothesis import strategies as st

from tral_env.calibration.camera_info import camera_info, load_lens, parse_camera_info, write_camera_info
from tral_env.config import WIDE_LENS, CameraConfig
from tral_env.errors import CalibrationError, ConfigError, UnreadableCalibrationError
from tral_env.perception.rays import lens_arrays

FROM_ROS = """
# written by a calibrator that likes blocks
image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data:
  - 335.9
  - 0
  - 330.2
  - 0.
  - 333.6
  - 249.6
  - 0
  - 0
  - 1
camera_model: plumb_bob
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 4, data: [-0.162, 1e-05, -0.0016, -0.0047]}
"""


def test_a_lens_is_written_as_ros_writes_it():
    assert camera_info(WIDE_LENS, "webcam") == (
        "image_width: 640\n"
        "image_height: 480\n"
        "camera_name: webcam\n"
        "camera_matrix:\n"
        "  rows: 3\n"
        "  cols: 3\n"
        "  data: [335.9, 0.0, 330.2, 0.0, 333.6, 249.6, 0.0, 0.0, 1.0]\n"
        "distortion_model: plumb_bob\n"
        "distortion_coefficients:\n"
        "  rows: 1\n"
        "  cols: 5\n"
        "  data: [-0.162, 0.0157, -0.0016, -0.0047, 0.0]\n"
        "rectification_matrix:\n"
        "  rows: 3\n"
        "  cols: 3\n"
        "  data: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]\n"
        "projection_matrix:\n"
        "  rows: 3\n"
        "  cols: 4\n"
        "  data: [335.9, 0.0, 330.2, 0.0, 0.0, 333.6, 249.6, 0.0, 0.0, 0.0, 1.0, 0.0]\n"
    )


FINITE = st.floats(-1e3, 1e3)
FOCAL = st.floats(1.0, 1e5)


@given(st.integers(1, 9999), st.integers(1, 9999), FOCAL, FOCAL, FINITE, FINITE, st.tuples(*[FINITE] * 5), st.text())
def test_a_lens_read_again_is_the_same_to_the_last_bit(width, height, fx, fy, cx, cy, distortion, name):
    lens = CameraConfig(width=width, height=height, fx=fx, fy=fy, cx=cx, cy=cy, distortion=distortion)
    assert parse_camera_info(camera_info(lens, name), "text") == lens


def test_a_file_of_another_calibrator_is_read():
    lens = parse_camera_info(FROM_ROS, "text")
    assert lens == CameraConfig(fx=335.9, fy=333.6, cx=330.2, cy=249.6, distortion=(-0.162, 1e-05, -0.0016, -0.0047, 0))


READ = CameraConfig(fx=335.9, fy=333.6, cx=330.2, cy=249.6, distortion=(-0.162, 1e-05, -0.0016, -0.0047, 0))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("-0.0047]", "-0.0047, 0, 0, 0, 0]"),
        ("-0.0047]", "-0.0047" + 8 * ", 0" + "]"),
        ("-0.0047]", "-0.0047" + 10 * ", 0" + "]"),
        ("distortion_model: plumb_bob", "distortion_model: rational_polynomial"),
        ("distortion_model: plumb_bob", "distortion_model: ''"),
        ("distortion_model: plumb_bob", "distortion_model: Plumb-Bob"),
        ("distortion_model: plumb_bob\n", ""),
        ("camera_model: plumb_bob\ndistortion_model: plumb_bob\n", ""),
        ("camera_model: plumb_bob\ndistortion_model: plumb_bob\n", "camera_model: pinhole\n"),
        ("image_width: 640", "image_width: 640.0"),
        ("[-0.162, 1e-05, -0.0016, -0.0047]", "[-0.162 1e-05 -0.0016 -0.0047]"),
        ("[-0.162, 1e-05, -0.0016, -0.0047]", "[-0.162 1e-05\n  -0.0016 -0.0047]"),
        ("[-0.162, 1e-05, -0.0016, -0.0047]", "-0.162  1e-05 -0.0016 -0.0047"),
        ("[-0.162, 1e-05, -0.0016, -0.0047]", "[[-0.162, 1e-05, -0.0016, -0.0047]]"),
        ("{rows: 1, cols: 4, data: [-0.162, 1e-05, -0.0016, -0.0047]}", "[-0.162, 1e-05, -0.0016, -0.0047]"),
        ("camera_name: narrow_stereo", "roi: {x_offset: 0, width: 0}"),
    ],
)
def test_one_lens_is_written_in_many_ways(old, new):
    assert old in FROM_ROS
    assert parse_camera_info(FROM_ROS.replace(old, new), "text") == READ


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_file_may_begin_with_a_byte_order_mark(tmp_path: Path, encoding):
    (tmp_path / "lens.yaml").write_text(FROM_ROS, encoding)
    assert load_lens(tmp_path / "lens.yaml") == READ


@pytest.mark.parametrize("nothing", ["[]", "", "{rows: 0, cols: 0, data: []}"])
def test_no_coefficients_are_no_distortion(nothing):
    text = FROM_ROS[: FROM_ROS.index("distortion_coefficients")] + f"distortion_coefficients: {nothing}\n"
    assert parse_camera_info(text, "text").distortion == (0, 0, 0, 0, 0)


ECHOED = """header:
  stamp: {{sec: 17, nanosec: 5}}
  frame_id: camera
height: {0.height}
width: {0.width}
distortion_model: plumb_bob
{names[0]}:
- {0.distortion[0]!r}
- {0.distortion[1]!r}
- {0.distortion[2]!r}
- {0.distortion[3]!r}
- {0.distortion[4]!r}
{names[1]}:
- {0.fx!r}
- 0.0
- {0.cx!r}
- 0.0
- {0.fy!r}
- {0.cy!r}
- 0.0
- 0.0
- 1.0
{names[2]}: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
{names[3]}: [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]
binning_x: 0
binning_y: 0
roi: {{x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false}}
---
"""
LENS = st.builds(
    CameraConfig,
    width=st.integers(1, 9999),
    height=st.integers(1, 9999),
    fx=FOCAL,
    fy=FOCAL,
    cx=FINITE,
    cy=FINITE,
    distortion=st.tuples(*[FINITE] * 5),
)


@given(LENS, st.sampled_from(["dkrp", "DKRP"]), st.integers(1, 3))
def test_a_topic_of_ros_is_a_lens(lens, names, messages):
    assert parse_camera_info(messages * ECHOED.format(lens, names=names), "text") == lens


def test_messages_that_differ_are_refused():
    text = ECHOED.format(CameraConfig(), names="dkrp") + ECHOED.format(WIDE_LENS, names="dkrp")
    with pytest.raises(CalibrationError, match="text: 2 lenses between lines of '---' that differ"):
        parse_camera_info(text, "text")


def test_a_camera_that_nobody_calibrated_says_so():
    text = ECHOED.format(CameraConfig(), names="dkrp").replace("554.256", "0.0")
    text = text.replace("319.5", "0.0").replace("239.5", "0.0").replace("- 1.0", "- 0.0")
    with pytest.raises(CalibrationError, match=r"text:13: k is 0: the camera is not calibrated. Run `tral calibrate`"):
        parse_camera_info(text, "text")


def stored_by_opencv(lens: CameraConfig, path: Path) -> str:
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    file.write("calibration_time", "Thu Nov 26 20:32:07 2026")
    file.write("image_width", lens.width)
    file.write("image_height", lens.height)
    matrix, distortion = lens_arrays(lens)
    file.write("camera_matrix", matrix)
    file.write("distortion_coefficients", distortion[:, None])
    file.write("avg_reprojection_error", 0.2)
    file.release()
    return path.read_text("utf-8")


@given(LENS, st.sampled_from(["%YAML:1.0", "%YAML:1.0\n---", "%YAML 1.2\n---", "%YAML 1.1\n---"]))
def test_a_file_storage_of_opencv_is_a_lens(tmp_path_factory, lens, header):
    path = tmp_path_factory.mktemp("opencv") / "camera.yml"
    body = stored_by_opencv(lens, path).split("---\n", 1)[1]
    assert "!!opencv-matrix" in body
    path.write_text(f"{header}\n{body}", "utf-8")
    assert load_lens(path) == lens


def test_lines_of_a_file_storage_are_counted_as_an_editor_does(tmp_path: Path):
    body = stored_by_opencv(WIDE_LENS, tmp_path / "camera.yml").split("---\n", 1)[1]
    with pytest.raises(CalibrationError, match=r"^lens.yml:4: image_width = 'wide'"):
        parse_camera_info("%YAML:1.0\n---\n" + body.replace("640", "wide"), "lens.yml")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("image_width: 640", "", r"image_width missing. There: image_height, .* Add a line such as 'image_width: 640'"),
        ("- 333.6", "- 333,6", r"lens.yaml:14: camera_matrix.data\[4\] = '333,6': .* a point parts the decimals"),
        ("camera_name", "image_height", r"lens.yaml:5:1: 'image_height' stands twice, first in line 4: delete one"),
        ("  rows: 3", "  rows: 3\n  rows: 3", r"lens.yaml:8:3: 'rows' stands twice, first in line 7"),
        ("camera_name: narrow_stereo", "K: []", r"'K' in line 5 and 'camera_matrix' in line 6 both mean camera_matrix"),
        (
            "camera_model: plumb_bob\ndistortion_model: plumb_bob",
            "fisheye_model: 1",
            r"fisheye_model 1: a fisheye",
        ),
        ("camera_name: narrow_stereo", "binning_x: 2", r"lens.yaml:5: binning_x = 2: .* unbinned"),
        ("camera_name: narrow_stereo", "roi: {x_offset: 8}", r"lens.yaml:5: roi = .*: .* whole images"),
        ("-0.0047]", "-0.0047, 0, 0.1, 0, 0]", r"only k1, k2, p1, p2, k3 .* `tral calibrate`, and with 3 radial terms"),
        ("-0.0047]", "-0.0047, 0, [1, 2]]", r"7 numbers: expected"),
        ("[-0.162, 1e-05", "[[-0.162 1e-05] [", r"lens.yaml:21:\d+: not YAML: .* a ',' or a ']' missing"),
        ("  rows: 3", "\trows: 3", r"lens.yaml:\d+:1: not YAML: .* indented by spaces"),
        ("640", "640.5", r"lens.yaml:3: image_width = 640.5: expected a whole number of pixels"),
        ("- 335.9", "- wide", r"camera_matrix.data\[0\] = 'wide': expected a finite number"),
        ("- 335.9", "- 1" + 400 * "0", r"camera_matrix.data\[0\] = 1.*: expected a finite number"),
        ("- 335.9", "- .nan", r"camera_matrix.data\[0\] = nan: expected a finite number"),
        ("- 335.9", "- true", r"camera_matrix.data\[0\] = True: expected a finite number"),
        ("- 335.9", "- -335.9", r"lens.yaml: CameraConfig.fx = -335.9: expected a number above 0"),
        ("  - 1\n", "", r"lens.yaml:6: camera_matrix: got .*, 8 numbers: expected 9 numbers"),
        ("- 0.\n", "- 2.0\n", r"expected \[fx, 0, cx, 0, fy, cy, 0, 0, 1\]"),
        ("distortion_model: plumb_bob", "distortion_model: plum_bob", r"did you mean 'plumb_bob'"),
        (
            "distortion_model: plumb_bob",
            "distortion_model: equidistant",
            r"lens.yaml:20: distortion_model 'equidistant': a fisheye .* with 3 radial terms",
        ),
        (
            "distortion_model: plumb_bob",
            "distortion_model: [plumb_bob]",
            r"distortion_model \['plumb_bob'\]: .*Allowed",
        ),
        ("image_width: 640", "image_width: 1" + 30 * "0", r"image_width = 10*.*: expected .* 1 to 65535"),
        ("-0.0047]", "-0.0047, 0, 0]", r"lens.yaml:21: .*, 6 numbers: expected 0, 4, 5, 8, 12 or 14 numbers"),
        ("image_height: 480", "image_height: [480", r"lens.yaml:\d+:\d+: not YAML"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_with_its_place(old, new, message):
    assert old in FROM_ROS
    with pytest.raises(CalibrationError, match=message):
        parse_camera_info(FROM_ROS.replace(old, new), "lens.yaml")


NO_VALUES = ["a: !!bool foo", 'a: !!int ""', "a: !!timestamp x"]


@pytest.mark.parametrize(
    "text", ["", "3", "- a\n- b", "!!python/object/apply:os.system [ls]", "a: !x b", "\x00", *NO_VALUES]
)
def test_what_is_no_lens_at_all_is_refused(text):
    with pytest.raises(CalibrationError):
        parse_camera_info(text, "lens.yaml")


def test_an_error_is_short_however_much_was_got():
    tenfold = "u: &u [0, 0, 0, 0, 0, 0, 0, 0, 0, 0]\n"
    for one, many in zip("uvwxy", "vwxyz", strict=True):
        tenfold += f"{many}: &{many} [{', '.join([f'*{one}'] * 10)}]\n"
    text = tenfold + FROM_ROS.replace("camera_matrix:", "camera_matrix: *z\nunused:")
    with pytest.raises(CalibrationError, match="camera_matrix: got") as caught:
        parse_camera_info(text, "lens.yaml")
    assert len(str(caught.value)) < 1000


@given(st.text())
def test_any_text_is_a_lens_or_a_calibration_error(text):
    with pytest.raises(CalibrationError):
        parse_camera_info(text, "lens.yaml")


def test_a_lens_is_found_by_name_by_path_and_by_value(tmp_path: Path):
    path = tmp_path / "Webcam.YML"
    write_camera_info(path, WIDE_LENS)
    assert (
        load_lens("wide")
        == load_lens(path)
        == load_lens(str(path))
        == load_lens(
            {"fx": 335.9, "fy": 333.6}
            | {"cx": 330.2, "cy": 249.6, "distortion": [-0.162, 0.0157, -0.0016, -0.0047, 0.0]}
        )
        == WIDE_LENS
    )
    assert load_lens(None) == load_lens("default") == CameraConfig()


def test_an_unknown_name_is_refused():
    with pytest.raises(ConfigError, match=r"unknown lens 'wied': did you mean 'wide'\?.*has to end in .yaml"):
        load_lens("wied")


def test_a_missing_file_is_refused(tmp_path: Path):
    with pytest.raises(UnreadableCalibrationError, match=r"the lens '.*none.yaml': No such file or directory$"):
        load_lens(tmp_path / "none.yaml")


def test_a_file_is_replaced_at_once_and_nothing_else_is_left(tmp_path: Path):
    path = tmp_path / "lens.yaml"
    for lens in (CameraConfig(), WIDE_LENS):
        write_camera_info(path, lens)
    assert load_lens(path) == WIDE_LENS
    assert [file.name for file in tmp_path.iterdir()] == ["lens.yaml"]


def test_a_file_that_cannot_be_written_is_an_error_in_words(tmp_path: Path):
    with pytest.raises(ConfigError, match="cannot be written"):
        write_camera_info(tmp_path / "no" / "lens.yaml", WIDE_LENS)


def test_a_link_to_a_lens_stays_a_link(tmp_path: Path):
    path, link = tmp_path / "lens.yaml", tmp_path / "link.yaml"
    write_camera_info(path, CameraConfig())
    link.symlink_to(path)
    write_camera_info(link, WIDE_LENS)
    assert link.is_symlink()
    assert load_lens(path) == WIDE_LENS


def test_what_could_not_be_put_in_place_leaves_nothing(tmp_path: Path):
    (tmp_path / "lens.yaml" / "full").mkdir(parents=True)
    with pytest.raises(ConfigError, match="cannot be written"):
        write_camera_info(tmp_path / "lens.yaml", WIDE_LENS)
    assert [file.name for file in tmp_path.iterdir()] == ["lens.yaml"]


def test_an_environment_reads_the_file_and_remembers_it(tmp_path: Path):
    path = str(tmp_path / "lens.yaml")
    write_camera_info(Path(path), WIDE_LENS)
    env = gym.make("tral_env:TralCorridor-v0", scenario="gates", lens=path)
    assert env.spec is not None
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert env.unwrapped.world.sim.lens == again.unwrapped.world.sim.lens == WIDE_LENS
    env.close()
    again.close()


def test_a_vector_environment_knows_lenses_by_name():
    env = gym.make_vec("tral_env:TralCorridor-v0", num_envs=2, scenario="straight", lens="wide")
    assert env.unwrapped.world.sim.lens == WIDE_LENS
    assert np.isfinite(env.reset(seed=1)[0]).all()
    env.close()
