"""What RViz is told of the car: its shape, its joints, where its sensors stand."""

from __future__ import annotations

import math
from xml.etree import ElementTree

import numpy as np
import pytest

from tral_env.course.generate import generate_plan
from tral_env.geometry import FRONT_SONAR_X_M, SIDE_SONAR_Y_M
from tral_env.ros import topics
from tral_env.ros.description import quaternion, robot_description, static_transforms
from tral_fsm.programs.ros.course_markers import course_markers


def test_the_model_is_one_tree_below_base_link() -> None:
    robot = ElementTree.fromstring(robot_description())
    links = {link.get("name") for link in robot.findall("link")}
    children = [joint.find("child").get("link") for joint in robot.findall("joint")]  # type: ignore[union-attr]
    parents = {joint.find("parent").get("link") for joint in robot.findall("joint")}  # type: ignore[union-attr]
    assert sorted([topics.BASE, *children]) == sorted(links)  # type: ignore[type-var]
    assert parents <= links


def test_its_moving_joints_are_those_of_joint_states() -> None:
    robot = ElementTree.fromstring(robot_description())
    moving = {joint.get("name") for joint in robot.findall("joint") if joint.get("type") != "fixed"}
    assert moving == {f"{wheel}_wheel_joint" for wheel in topics.WHEELS} | set(topics.STEERING_JOINTS)


def test_the_shell_is_where_the_model_of_mujoco_has_it() -> None:
    robot = ElementTree.fromstring(robot_description())
    tub = robot.find("link/visual[@name='tub']")
    assert tub is not None
    assert tub.find("origin").get("xyz") == "0.129 0 0.032"  # type: ignore[union-attr]
    assert tub.find("geometry/box").get("size") == "0.34 0.112 0.036"  # type: ignore[union-attr]


def test_sensors_stand_where_the_car_has_them() -> None:
    found = {each.child_frame_id: each for each in static_transforms(1)}
    front, left = found["ultrasonic_front"].transform, found["ultrasonic_left"].transform
    assert (front.translation.x, front.translation.y) == (FRONT_SONAR_X_M, 0.0)
    assert left.translation.y == SIDE_SONAR_Y_M
    assert 2 * math.atan2(left.rotation.z, left.rotation.w) == pytest.approx(math.pi / 2)
    assert found[topics.CAMERA_OPTICAL].header.frame_id == topics.CAMERA_LINK


def test_the_optical_frame_looks_ahead() -> None:
    turn = quaternion(-math.pi / 2, 0.0, -math.pi / 2)
    x, y, z, w = turn.x, turn.y, turn.z, turn.w
    ahead = [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)]
    assert ahead == pytest.approx([1.0, 0.0, 0.0], abs=1e-12)


def test_a_course_is_drawn_with_its_walls_gates_and_route() -> None:
    _, plan = generate_plan("gates", np.random.default_rng(3))
    drawn = course_markers(plan, 1).markers
    assert len({each.id for each in drawn}) == len(drawn)
    names = [each.ns for each in drawn]
    assert names.count("gate") == len(plan.gate_id)
    assert names.count("route") == 1
    assert sum(each.type == 1 for each in drawn) == len(plan.box_position)


def test_the_camera_stands_where_the_car_file_says() -> None:
    placed = {each.child_frame_id: each.transform.translation.x for each in static_transforms(0, 0.1)}
    assert placed[topics.CAMERA_LINK] == 0.1
    assert placed[topics.sonar_frame("front")] != 0.1
    camera = ElementTree.fromstring(robot_description(0.1)).find("joint[@name='camera_link_joint']/origin")
    assert camera is not None
    assert camera.get("xyz", "").split()[0] == "0.1"
