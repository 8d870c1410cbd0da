"""Names of topics, frames and joints. A topic without a leading slash lies in the node's namespace."""

from __future__ import annotations

SIDES = ("left", "front", "right")
RANGES = {side: f"ultrasonic/{side}" for side in SIDES}
"""sensor_msgs/Range"""
ODOMETRY = "odom"
"""nav_msgs/Odometry: dead reckoning from hall sensor and steering. The last message of a tick."""
JOINTS = "joint_states"
"""sensor_msgs/JointState: the way of the wheels, and the steering."""
APPLIED = "ackermann_state"
"""ackermann_msgs/AckermannDriveStamped: the command as applied."""
IMU = "imu/data"
"""sensor_msgs/Imu"""
BATTERY = "battery_state"
"""sensor_msgs/BatteryState"""
DETECTIONS = "detections"
"""vision_msgs/Detection3DArray: gate and marker, for each image, also an empty one."""
IMAGE = "camera/image_raw/compressed"
"""sensor_msgs/CompressedImage"""
CAMERA_INFO = "camera/camera_info"
"""sensor_msgs/CameraInfo"""
CAMERA_URL = "camera/url"
"""std_msgs/String, latched: where a simulated car serves its images."""
SPEED_COMMAND = "ackermann_cmd"
"""ackermann_msgs/AckermannDriveStamped: steering angle, and a speed that the car regulates on its hall sensor."""
THROTTLE_COMMAND = "ackermann_cmd_open_loop"
"""ackermann_msgs/AckermannDriveStamped: steering angle, and a speed that is a throttle; see `commands`."""
ARM = "arm"
"""std_msgs/Bool: true arms, false stops."""
ARMED = "armed"
"""std_msgs/Bool, latched: whether the car takes commands."""
RESET = "simulation/reset"
"""std_msgs/Int64: the simulated car goes to the start of the course of this seed."""
RESULT = "simulation/result"
"""std_msgs/String, latched: how the simulated drive ended, as JSON."""
TRUTH = "ground_truth/odom"
"""nav_msgs/Odometry: where the simulated car is."""
COURSE = "course_markers"
"""visualization_msgs/MarkerArray, latched: walls, route, gates."""
DESCRIPTION = "robot_description"
"""std_msgs/String, latched: the car as URDF."""
STATE = "~/state"
"""std_msgs/String, latched: the active state."""
TRANSITION = "~/transition_event"
"""lifecycle_msgs/TransitionEvent: each transition; its label says why."""
TF, TF_STATIC = "tf", "tf_static"
DIAGNOSTICS = "/diagnostics"
CLOCK = "/clock"

MAP, ODOM, BASE = "map", "odom", "base_link"
"""REP 105. base_link: on the ground below the middle of the rear axle."""
CAMERA_LINK, CAMERA_OPTICAL = "camera_link", "camera_optical_frame"
IMU_LINK = "imu_link"


def sonar_frame(side: str) -> str:
    """Frame of an ultrasonic, which looks along its x axis."""
    return f"ultrasonic_{side}"


WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
HALL_WHEEL = "rear_left_wheel_joint"
"""The hall sensor counts on this wheel."""
STEERING_JOINTS = ("front_left_steering_joint", "front_right_steering_joint")
