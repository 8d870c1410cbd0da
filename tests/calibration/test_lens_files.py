"""Lens files of other programs: Kalibr, OpenCV's XML, ROS 1's .ini."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from tral_env.calibration.camera_info import camera_info, load_lens, parse_camera_info
from tral_env.config import CameraConfig
from tral_env.errors import CalibrationError

KALIBR = """\
cam0:
  cam_overlaps: []
  camera_model: pinhole
  distortion_coeffs: [-0.2834, 0.0740, 0.00019, 1.76e-05]
  distortion_model: radtan
  intrinsics: [458.654, 457.296, 367.215, 248.375]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
"""
INI = """\
# oST version 5.0 parameters


[image]

width
640

height
480

[narrow_stereo]

camera matrix
438.783367 0.000000 305.593336
0.000000 437.302876 243.738352
0.000000 0.000000 1.000000

distortion
-0.361976 0.110510 0.001014 0.000505 0.000000

rectification
0.999978 0.002789 -0.006046
-0.002816 0.999986 -0.004401
0.006034 0.004417 0.999972

projection
393.653800 0.000000 322.797939 0.000000
0.000000 393.653800 241.090902 0.000000
0.000000 0.000000 1.000000 0.000000
"""
XML = """\
<?xml version="1.0" encoding="UTF-8"?>
<opencv_storage>
<calibration_time>"Fri 03 May 2019 10:21:32"</calibration_time>
<image_width>640</image_width>
<image_height>480</image_height>
<fix_aspect_ratio>1.</fix_aspect_ratio>
<fisheye_model>0</fisheye_model>
<camera_matrix type_id="opencv-matrix">
  <rows>3</rows>
  <cols>3</cols>
  <dt>d</dt>
  <data>
    6.5746697810243404e+02 0. 3.1950000000000000e+02 0.
    6.5746697810243404e+02 2.3950000000000000e+02 0. 0. 1.</data></camera_matrix>
<distortion_coefficients type_id="opencv-matrix">
  <rows>5</rows>
  <cols>1</cols>
  <dt>d</dt>
  <data>
    -4.1802327018241026e-01 5.0715243805833121e-01 0. 0.
    -5.7843596847939704e-01</data></distortion_coefficients>
<per_view_errors><_>1.5e-01</_><_>1.4e-01</_></per_view_errors>
</opencv_storage>
"""


OMNI = KALIBR.replace("pinhole", "omni").replace("[458.654", "[1.7, 458.654")


def test_a_camchain_of_kalibr_is_read() -> None:
    assert parse_camera_info(KALIBR, "camchain.yaml") == CameraConfig(
        width=752, height=480, fx=458.654, fy=457.296, cx=367.215, cy=248.375,
        distortion=(-0.2834, 0.0740, 0.00019, 1.76e-05, 0.0),
    )  # fmt: skip


def test_an_ini_of_ros_1_is_read(tmp_path: Path) -> None:
    (tmp_path / "ost.ini").write_text(INI)
    assert load_lens(tmp_path / "ost.ini") == load_lens(str(tmp_path / "ost.ini"))
    assert load_lens(tmp_path / "ost.ini") == CameraConfig(
        fx=438.783367, fy=437.302876, cx=305.593336, cy=243.738352,
        distortion=(-0.361976, 0.110510, 0.001014, 0.000505, 0.0),
    )  # fmt: skip


def test_an_xml_of_opencv_is_read() -> None:
    assert parse_camera_info(XML, "camera.xml") == CameraConfig(
        fx=657.46697810243404, fy=657.46697810243404, cx=319.5, cy=239.5,
        distortion=(-0.41802327018241026, 0.50715243805833121, 0.0, 0.0, -0.57843596847939704),
    )  # fmt: skip


def test_what_this_opencv_writes_is_read(tmp_path: Path) -> None:
    file, lens = tmp_path / "lens.xml", CameraConfig(distortion=(-0.1, 0.01, 0.001, -0.002, 0.0))
    storage = cv2.FileStorage(str(file), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", lens.width)
    storage.write("image_height", lens.height)
    storage.write("camera_matrix", np.array([[lens.fx, 0.0, lens.cx], [0.0, lens.fy, lens.cy], [0.0, 0.0, 1.0]]))
    storage.write("distortion_coefficients", np.array([lens.distortion]))
    storage.release()
    assert load_lens(file) == lens


@pytest.mark.parametrize("number", ["640", "640.", "640.0", "6.4e+02"])
@pytest.mark.parametrize(("text", "old"), [(INI, "640"), (XML, "640"), (KALIBR, "752")])
def test_a_whole_number_may_be_written_as_a_decimal(text: str, old: str, number: str) -> None:
    assert parse_camera_info(text.replace(old, number, 1), "file").width == 640


def test_opencv_writes_texts_in_quotes_and_each_decimal_with_a_point() -> None:
    text = XML.replace("<fisheye_model>0<", '<distortion_model>"plumb_bob"</distortion_model><fisheye_model>0.<')
    assert parse_camera_info(text, "file") == parse_camera_info(XML, "file")


@pytest.mark.parametrize("more", ["resolution: 640x480\n", "intrinsics: {fx: 500}\n", "intrinsics: [1, 2, 3, 4]\n"])
def test_keys_of_kalibr_in_a_file_of_ros_are_its_own(more: str) -> None:
    lens = CameraConfig(distortion=(-0.1, 0.01, 0.001, -0.002, 0.0))
    assert parse_camera_info(camera_info(lens) + more, "file") == lens


@pytest.mark.parametrize("coefficients", ["distortion_coeffs: []", "rosbag: a.bag"])
def test_a_lens_of_kalibr_may_have_no_distortion(coefficients: str) -> None:
    text = KALIBR.replace("radtan", "none").replace(
        "distortion_coeffs: [-0.2834, 0.0740, 0.00019, 1.76e-05]", coefficients
    )
    assert parse_camera_info(text, "file").distortion == (0.0,) * 5


def test_yaml_may_begin_with_a_merge_key() -> None:
    text = "<<: {image_width: 640, image_height: 480}\n" + camera_info(CameraConfig()).split("\n", 2)[2]
    assert parse_camera_info(text, "file") == CameraConfig()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            KALIBR.replace("radtan", "equidistant"),
            r"file:5: distortion_model 'equidistant': a fisheye lens.*tral calib",
        ),
        (OMNI, r"file:3: camera_model: 'omni': .*Allowed: pinhole, .*run|calibrate with"),
        (KALIBR.replace("radtan", "none"), r"file:4: distortion_coeffs .*: but the distortion model is 'none'"),
        (KALIBR + "camera_matrix: [1, 0, 0]\n", "file: cam0 and camera_matrix both tell a lens"),
        ("<opencv_storage>" + "<a>" * 200_000, "file:1: <a> lies within 8 others"),
        ("<opencv_storage>\ud800", "file: not XML: .*surrogates not allowed"),
        (KALIBR.replace("458.654, ", ""), r"file:6: intrinsics: expected \[fu, fv, pu, pv\]"),
        (KALIBR.replace("[752, 480]", "752"), r"file:7: resolution: expected \[width, height\]"),
        (KALIBR.replace("458.654", "wide"), r"file:6: intrinsic_matrix\[0\] = 'wide': expected a finite number"),
        (KALIBR + KALIBR.replace("cam0", "cam1"), "file: 2 cameras, cam0, cam1: keep one of them"),
        (INI.replace("0.110510", "abc"), r"file:20: distortion\[1\] = 'abc': expected a finite number"),
        (INI.replace("640", "640.5"), r"file:6: width = 640\.5: expected a whole number of pixels"),
        (INI + INI[INI.index("camera") :], r"file:\d+: 'camera matrix' stands twice, first in line 14"),
        (INI.replace("height\n480\n", ""), "file: image_height missing"),
        (XML.replace("<fisheye_model>0", "<fisheye_model>1"), "file:7: fisheye_model 1: a fisheye lens"),
        (XML.replace("</opencv_storage>", ""), "file:2[0-9]:1: not XML: no element found"),
        (XML.replace("opencv_storage", "svg"), "got XML with <svg>, expected OpenCV's <opencv_storage>"),
        (XML.replace("6.5746697810243404e+02 0.", "six57 0.", 1), r"file:12: camera_matrix\.data\[0\] = 'six57'"),
        ('<!DOCTYPE a [<!ENTITY b "bb">]><opencv_storage/>', "file:1: entities are not read"),
    ],
)
def test_what_is_wrong_in_a_file_is_told_with_its_place(text: str, told: str) -> None:
    with pytest.raises(CalibrationError, match=told):
        parse_camera_info(text, "file")
