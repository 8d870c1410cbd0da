"""`tral ros` as a command: parameters, and what is refused."""

from __future__ import annotations

import logging
import math
import os
import re
import runpy
import signal
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from tral_env.errors import BadFileError, ConfigError, HardwareError
from tral_env.ros.parameters import read_parameters
from tral_fsm.cli import app
from tral_fsm.cli.console import BAD_USAGE
from tral_fsm.cli.ros import NODES, _until_stopped
from tral_fsm.programs.ros.asked import Asked
from tral_fsm.programs.ros.nodes import camera_node, car_node, has_images

PACKAGED = Path(__file__).parents[2] / "tral_env/ros/config/tral.yaml"


def tral(*arguments: str) -> Any:
    return CliRunner().invoke(app, ["ros", *arguments])


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"use_sim_time": True, "backend": "twin"}, "lives in real time"),
        ({"lock_step": True, "camera": "rendered"}, "rendered images come in real time"),
        ({"dry": True}, "moves no real car"),
        ({"camera_timeout": math.nan}, "camera_timeout = nan"),
        ({"camera_timeout": 0.0}, "camera_timeout = 0.0: expected a number above 0, at most 10 s"),
        ({"command_timeout": 60.0}, "command_timeout = 60.0"),
    ],
)
def test_what_does_not_fit_together_is_refused(options: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        Asked(**options)


def file(folder: Path, text: str) -> Path:
    path = folder / "p.yaml"
    path.write_text(text)
    return path


def test_parameters_of_a_node_count_more_than_those_of_all(tmp_path: Path) -> None:
    path = file(
        tmp_path,
        "car:\n  ros__parameters: {seed: 2}\n/**:\n  ros__parameters: {seed: 1, camera: rendered}\n"
        "fsm:\n  ros__parameters: {policy: wall}\nrviz2:\n  ros__parameters: {anything: 1}\n",
    )
    assert read_parameters(path, NODES, ["car"]) == {"seed": 2, "camera": "rendered"}


def test_what_is_for_all_nodes_is_for_those_that_have_it(tmp_path: Path) -> None:
    path = file(tmp_path, "/**:\n  ros__parameters: {use_sim_time: true, namespace: car1}\n")
    assert read_parameters(path, NODES, ["fsm"]) == {"use_sim_time": True, "namespace": "car1"}
    assert read_parameters(path, NODES, ["camera"]) == {"namespace": "car1"}


def test_one_process_takes_the_parameters_of_all_its_nodes(tmp_path: Path) -> None:
    text = "car:\n  ros__parameters: {seed: 2, namespace: /a}\nfsm:\n  ros__parameters: {policy: wall, namespace: /a}\n"
    assert read_parameters(file(tmp_path, text), NODES, list(NODES)) == {"seed": 2, "namespace": "/a", "policy": "wall"}


def test_two_values_for_one_process_are_refused(tmp_path: Path) -> None:
    text = "car:\n  ros__parameters: {namespace: /a}\nfsm:\n  ros__parameters: {namespace: /b}\n"
    path = file(tmp_path, text)
    with pytest.raises(BadFileError, match=r"car and fsm have two values of 'namespace'.*below /\*\*"):
        read_parameters(path, NODES, list(NODES))
    assert read_parameters(path, NODES, ["fsm"]) == {"namespace": "/b"}


@pytest.mark.parametrize("text", ["[1]", "car: 3", "car: {seed: 1}", "a: ["])
def test_a_file_that_is_none_is_refused(text: str, tmp_path: Path) -> None:
    with pytest.raises(BadFileError, match=r"p\.yaml"):
        read_parameters(file(tmp_path, text), NODES, ["car"])


@pytest.mark.parametrize("command", ["car", "camera", "fsm", "up"])
@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("fsm:\n  ros__parameters: {polcy: wall}\n", "fsm: unknown parameter 'polcy': did you mean 'policy'?"),
        ("/**:\n  ros__parameters: {sed: 1}\n", "/**: unknown parameter 'sed': did you mean 'seed'?"),
        ("fsm:\n  ros__parameters: {scenario: office}\n", "fsm: unknown parameter 'scenario'"),
    ],
)
def test_an_unknown_parameter_is_refused_with_the_nearest_one(
    command: str, text: str, said: str, tmp_path: Path
) -> None:
    result = tral(command, "--params-file", str(file(tmp_path, text)))
    assert result.exit_code == 1
    assert said in " ".join(result.stderr.split())


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Asked]:
    """What the node `fsm` is asked for; it does not begin."""
    found: list[Asked] = []

    def noted(each: Asked) -> None:
        found.append(each)
        raise ConfigError("enough")

    monkeypatch.setattr("tral_fsm.programs.ros.nodes.fsm_node", noted)
    return found


def test_all_nodes_in_one_process_read_the_file_of_the_launch_and_the_command_line_counts_more(
    tmp_path: Path, asked: list[Asked]
) -> None:
    path = file(tmp_path, PACKAGED.read_text().replace("seed: 7", "seed: 8").replace("policy: office", "policy: wall"))
    tral("up", "--params-file", str(path), "--scenario", "gates")
    assert (asked[0].seed, asked[0].policy, asked[0].scenario) == (8, "wall", "gates")


def test_the_packaged_file_has_each_node_and_the_defaults() -> None:
    given = read_parameters(PACKAGED, NODES, list(NODES))
    assert Asked(**given) == Asked()


class Launched:
    """Stands in for the classes of `launch`: keeps what it is given."""

    def __init__(self, *given: Any, **named: Any) -> None:
        self.given, self.named = given, named


def test_the_launch_file_starts_commands_that_there_are_with_a_file_that_there_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    names = {
        "launch": ["LaunchDescription"],
        "launch.actions": ["DeclareLaunchArgument", "ExecuteProcess"],
        "launch.conditions": ["IfCondition"],
        "launch.substitutions": ["LaunchConfiguration"],
    }
    for name, classes in names.items():
        module = ModuleType(name)
        for each in classes:
            setattr(module, each, type(each, (Launched,), {}))
        monkeypatch.setitem(sys.modules, name, module)
    path = PACKAGED.parents[1] / "launch" / "tral.launch.py"
    (actions,) = runpy.run_path(str(path))["generate_launch_description"]().given
    declared = {each.given[0]: each.named["default_value"] for each in actions if "default_value" in each.named}
    assert Path(declared["params_file"]).is_file()
    started = [each.named["cmd"] for each in actions if "cmd" in each.named]
    assert [command[2] for command in started] == ["car", "fsm", "camera"]
    for _, group, node, *options in started:
        known = {name for each in nodes_of(group)[node].params for name in each.opts}
        assert {each for each in options if isinstance(each, str)} <= known
        assert {each.given[0] for each in options if isinstance(each, Launched)} <= set(declared)


def nodes_of(group: str) -> dict[str, Any]:
    found: Any = typer.main.get_command(app)
    return dict(found.commands[group].commands)


def test_a_namespace_that_is_none_is_refused() -> None:
    result = tral("fsm", "--policy", "wall", "--namespace", "/car 1")
    assert result.exit_code == BAD_USAGE
    assert "namespace" in result.stderr


CAMERA = '[camera]\ndevice = "/dev/no-such-camera"\n'


def car_file(folder: Path, text: str) -> str:
    path = folder / "car.toml"
    assert CliRunner().invoke(app, ["car", "init", str(path), "--board", "log"]).exit_code == 0
    path.write_text(path.read_text().partition("[camera]")[0] + text)
    return str(path)


def test_the_node_car_leaves_the_camera_of_the_car_file_to_the_node_camera(tmp_path: Path) -> None:
    asked = Asked(backend="car", config=car_file(tmp_path, CAMERA + 'lens = "default"\n'), dry=True)
    assert has_images(asked)
    node = car_node(asked)
    node.body.rest()
    node.close()


def test_a_camera_without_a_lens_stays_off(tmp_path: Path) -> None:
    assert not has_images(Asked(backend="car", config=car_file(tmp_path, CAMERA), dry=True))


@pytest.mark.parametrize("options", [("--policy", "no_such_policy"), ("--policy", "wall", "--namespace", "/car 1")])
def test_no_car_is_opened_when_another_option_is_wrong(
    options: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[object] = []
    monkeypatch.setattr("tral_fsm.programs.ros.nodes._body", opened.append)
    assert tral("up", *options).exit_code == BAD_USAGE
    assert opened == []


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("cra: {ros__parameters: {seed: 2}}", "did you mean 'car'"),
        ("/car1/**: {ros__parameters: {seed: 2}}", "the only pattern"),
        ("car: {seed: 2, ros__parameters: {}}", "'seed' stands beside 'ros__parameters'"),
        ("car:\n  ros__parameters:\n    seed: 2\n    seed: 3", ":4:"),
    ],
)
def test_no_parameter_is_dropped_without_a_word(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(BadFileError, match=re.escape(told)):
        read_parameters(file(tmp_path, text), NODES, list(NODES))


@pytest.mark.parametrize(
    ("namespace", "seed"), [(None, 3), ("/car1", 3), ("car1/", 3), ("/car2", 4), ("/car3", 2), ("", 5)]
)
def test_a_name_with_a_namespace_is_for_the_node_of_that_namespace_alone(
    namespace: str | None, seed: int, tmp_path: Path
) -> None:
    text = "".join(
        f"{section}: {{ros__parameters: {{seed: {seed}}}}}\n"
        for section, seed in (("/car1/car", 3), ("car", 2), ("car2/car", 4), ("/car", 5))
    )
    path = file(tmp_path, text + "/**: {ros__parameters: {namespace: /car1}}\n")
    assert read_parameters(path, NODES, ["car"], namespace)["seed"] == seed


def test_the_namespace_of_the_command_line_says_whose_parameters_count(tmp_path: Path, asked: list[Asked]) -> None:
    path = file(
        tmp_path,
        "/car1/fsm: {ros__parameters: {policy: wall}}\n/car2/fsm: {ros__parameters: {policy: gate}}\n",
    )
    for order in (["--params-file", str(path), "--namespace", "/car2"], ["--namespace=/car2", f"--params-file={path}"]):
        tral("fsm", *order)
    assert [each.policy for each in asked] == ["gate", "gate"]


@pytest.mark.parametrize("section", ["car", "/**", "/car1/car"])
def test_no_file_arms_a_car(section: str, tmp_path: Path) -> None:
    path = file(tmp_path, f"{section}: {{ros__parameters: {{arm: true}}}}\n")
    for command in ("car", "fsm", "up"):
        result = tral(command, "--params-file", str(path))
        assert result.exit_code == 1
        assert f"{section}: arm: a file arms no car" in " ".join(result.stderr.split())
    others = file(tmp_path, "gripper: {ros__parameters: {arm: left}}\n")
    assert read_parameters(others, NODES, list(NODES), refused={"arm": "no"}) == {}


def test_a_file_of_parameters_that_is_not_there_is_told(tmp_path: Path) -> None:
    result = tral("fsm", "--params-file", str(tmp_path / "none.yaml"))
    assert result.exit_code == 1
    assert "none.yaml: cannot be read" in " ".join(result.stderr.split())


@pytest.mark.parametrize(("before", "ends"), [(signal.SIG_DFL, True), (signal.SIG_IGN, False)])
def test_the_end_of_the_terminal_ends_the_nodes_unless_they_were_told_to_outlive_it(before: Any, ends: bool) -> None:
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    signal.signal(signal.SIGHUP, before)
    try:
        ended = _until_stopped()
        os.kill(os.getpid(), signal.SIGHUP)
        assert ended.is_set() is ends
        assert logging.getLogger("tral.ros.car").isEnabledFor(logging.INFO)
        assert not logging.getLogger("OpenGL").isEnabledFor(logging.INFO)
    finally:
        logging.getLogger("tral.ros").setLevel(logging.NOTSET)
        for number, handler in handlers.items():
            signal.signal(number, handler)


def test_another_camera_of_a_car_has_the_size_rate_and_latency_of_the_car_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[Any] = []
    monkeypatch.setattr("tral_fsm.programs.ros.nodes.CameraImages", opened.append)
    monkeypatch.setattr(
        "tral_fsm.programs.ros.nodes.StreamImages", lambda url, latency_s: opened.append((url, latency_s))
    )
    config = car_file(tmp_path, CAMERA + 'lens = "default"\nrate_hz = 20.0\nlatency_s = 0.04\n')
    for source in ("2", "http://here/stream"):
        node = camera_node(Asked(backend="car", config=config, source=source))
        assert node._open is not None
        node._open()
        node.node.close()
    assert (opened[0].device, opened[0].rate_hz, opened[0].latency_s) == (2, 20.0, 0.04)
    assert opened[1] == ("http://here/stream", 0.04)


def test_the_car_tells_where_the_camera_of_the_car_file_stands(tmp_path: Path) -> None:
    asked = Asked(backend="car", config=car_file(tmp_path, CAMERA + "forward = 0.1\n"), dry=True)
    node = car_node(asked)
    assert node.body.camera_x == 0.1
    node.close()


def test_a_car_whose_node_cannot_begin_is_closed_again(monkeypatch: pytest.MonkeyPatch) -> None:
    closed: list[bool] = []

    class Body:
        name = "bench"

        def close(self) -> None:
            closed.append(True)

    monkeypatch.setattr("tral_fsm.programs.ros.nodes._body", lambda asked: Body())
    monkeypatch.setenv("CYCLONEDDS_URI", "<CycloneDDS><NoSuchElement/></CycloneDDS>")
    with pytest.raises(HardwareError, match="CYCLONEDDS_URI"):
        car_node(Asked())
    assert closed == [True]
