"""Start the nodes `car`, `camera` and `fsm`: `ros2 launch PATH/tral.launch.py policy:=wall`."""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration

ARGUMENTS = {
    "params_file": str(Path(__file__).resolve().parents[1] / "config" / "tral.yaml"),
    "namespace": "",
    "backend": "simulation",
    "policy": "office",
    "camera": "false",
}


def generate_launch_description() -> LaunchDescription:
    """The three nodes; the node `camera` only with `camera:=true`."""
    value = LaunchConfiguration
    common = ["--namespace", value("namespace"), "--params-file", value("params_file")]
    backend = ["--backend", value("backend")]
    return LaunchDescription(
        [
            *(DeclareLaunchArgument(name, default_value=default) for name, default in ARGUMENTS.items()),
            ExecuteProcess(cmd=["tral", "ros", "car", *backend, *common], output="screen"),
            ExecuteProcess(cmd=["tral", "ros", "fsm", "--policy", value("policy"), *common], output="screen"),
            ExecuteProcess(
                cmd=["tral", "ros", "camera", *backend, *common],
                output="screen",
                condition=IfCondition(value("camera")),
            ),
        ]
    )
