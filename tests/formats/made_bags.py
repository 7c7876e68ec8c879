"""Bags as ROS would have recorded them, written by the writers of rosbags."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Literal

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

Kind = Literal["ros1", "mcap", "sqlite"]
KINDS: tuple[Kind, ...] = ("ros1", "mcap", "sqlite")
#: When the first sample is measured, ns since 1970.
START = 1_700_000_000_123_456_789


class Types:
    """Messages of ROS 1 or 2 by short calls; times in ns."""

    def __init__(self, ros1: bool) -> None:
        self.ros1 = ros1
        self.store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        if ros1:
            transforms = "geometry_msgs/TransformStamped[] transforms"
            self.store.register(get_types_from_msg(transforms, "tf2_msgs/msg/TFMessage"))

    def __call__(self, name: str, *fields: Any) -> Any:
        return self.store.types[name](*fields)

    def header(self, stamp: int, frame: str) -> Any:
        time = self("builtin_interfaces/msg/Time", stamp // 10**9, stamp % 10**9)
        return self("std_msgs/msg/Header", 0, time, frame) if self.ros1 else self("std_msgs/msg/Header", time, frame)

    def floats(self, values: Iterable[float]) -> Any:
        layout = self("std_msgs/msg/MultiArrayLayout", [], 0)
        return self("std_msgs/msg/Float64MultiArray", layout, np.array(list(values)))

    def joints(self, stamp: int, names: list[str], positions: Iterable[float]) -> Any:
        nothing = np.zeros(0)
        values = np.array(list(positions))
        return self("sensor_msgs/msg/JointState", self.header(stamp, "base"), names, values, nothing, nothing)

    def pose(self, position: Iterable[float], xyzw: Iterable[float]) -> Any:
        point = self("geometry_msgs/msg/Point", *map(float, position))
        return self("geometry_msgs/msg/Pose", point, self("geometry_msgs/msg/Quaternion", *map(float, xyzw)))

    def stamped(self, stamp: int, frame: str, position: Iterable[float], xyzw: Iterable[float]) -> Any:
        return self("geometry_msgs/msg/PoseStamped", self.header(stamp, frame), self.pose(position, xyzw))

    def odometry(self, stamp: int, frame: str, position: Iterable[float], xyzw: Iterable[float]) -> Any:
        zero = self("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        twist = self("geometry_msgs/msg/Twist", zero, zero)
        twist = self("geometry_msgs/msg/TwistWithCovariance", twist, np.zeros(36))
        pose = self("geometry_msgs/msg/PoseWithCovariance", self.pose(position, xyzw), np.zeros(36))
        return self("nav_msgs/msg/Odometry", self.header(stamp, frame), "tip", pose, twist)

    def transforms(self, stamp: int, listed: Iterable[tuple[str, str, Iterable[float], Iterable[float]]]) -> Any:
        made = [
            self(
                "geometry_msgs/msg/TransformStamped",
                self.header(stamp, parent),
                child,
                self(
                    "geometry_msgs/msg/Transform",
                    self("geometry_msgs/msg/Vector3", *map(float, position)),
                    self("geometry_msgs/msg/Quaternion", *map(float, xyzw)),
                ),
            )
            for parent, child, position, xyzw in listed
        ]
        return self("tf2_msgs/msg/TFMessage", made)


def write(
    folder: Path,
    kind: Kind,
    topics: dict[str, str],
    messages: Callable[[Types], Iterable[tuple[int, str, Any]]],
    types: Types | None = None,
) -> Path:
    """A bag of some topics with their types; messages come with the time of recording, ns, in this order."""
    types = types or Types(kind == "ros1")
    path = folder / ("run.bag" if kind == "ros1" else f"run_{kind}")
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    with Writer1(path) if kind == "ros1" else Writer2(path, version=9, storage_plugin=plugin) as writer:
        made = {topic: writer.add_connection(topic, of, typestore=types.store) for topic, of in topics.items()}
        serialize = types.store.serialize_ros1 if kind == "ros1" else types.store.serialize_cdr
        for received, topic, message in messages(types):
            writer.write(made[topic], received, bytes(serialize(message, made[topic].msgtype)))
    return path


TOPICS = {
    "/valves": "std_msgs/msg/Float64MultiArray",
    "/joints": "sensor_msgs/msg/JointState",
    "/tip": "geometry_msgs/msg/PoseStamped",
    "/odom": "nav_msgs/msg/Odometry",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/note": "std_msgs/msg/String",
    "/empty": "std_msgs/msg/Float64",
}
XYZW = (0.1, 0.2, 0.4, (1 - 0.21) ** 0.5)


def arm_messages(types: Types, count: int = 50) -> Iterable[tuple[int, str, Any]]:
    """Pressures and lengths at 100 Hz, each with a clock of its own, poses at 50 Hz."""
    for k in range(count):
        now = START + k * 10_000_000
        yield now, "/valves", types.floats([0.1 * k, 0.2 * k, 0.3 * k])
        # The order of the joints changes: what counts are their names.
        order = ["lift", "left", "right"] if k % 3 else ["right", "lift", "left"]
        lengths = {"lift": 150.0 + k, "left": 160.0 + k, "right": 170.0 + k}
        yield now + 2_000_000, "/joints", types.joints(now + 1_000_000, order, [1e-3 * lengths[name] for name in order])
        yield now + 2_000_000, "/note", types("std_msgs/msg/String", "hello")
        if k % 2 == 0:
            at = (1e-3 * k, 0.2, 0.3)
            yield now + 5_000_000, "/tip", types.stamped(now + 3_000_000, "mocap", at, XYZW)
            yield now + 5_000_000, "/odom", types.odometry(now + 3_000_000, "mocap", at, XYZW)
            pairs = [("mocap", "tip", at, XYZW), ("mocap", "base", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))]
            yield now + 5_000_000, "/tf", types.transforms(now + 3_000_000, pairs)
