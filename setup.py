# SPDX-License-Identifier: Apache-2.0
from glob import glob

from setuptools import find_packages, setup

NAME = "billiards_sim"

# rclpy and messages for machines without a ROS installation
ROS = [
    "ros-jazzy-rclpy[fastrtps]",
    "ros-jazzy-std-msgs",
    "ros-jazzy-geometry-msgs",
    "ros-jazzy-sensor-msgs",
    "ros-jazzy-visualization-msgs",
    "ros-jazzy-std-srvs",
    "ros-jazzy-rosgraph-msgs",
    "pyyaml",
    "mcap",  # for bags; where ROS is installed, this alone
]
FAST = ["numba"]
PLAY = ["tornado", "pyyaml"]
PROGRESS = ["tqdm"]
GYM = ["gymnasium>=1.1", "matplotlib", "tqdm", "pillow>=10.1"]
PLOT = ["matplotlib", "tqdm", "pillow>=10.1", "imageio-ffmpeg"]
# what `benchmark` compares with; pooltool, a third, pins a panda3d that is not to be had: see docs/benchmark
PEERS = ["pymunk", "mujoco"]

setup(
    name=NAME,
    version="0.1.0",
    description="A billiards table as a ROS 2 node over an exact, event-driven engine",
    license="Apache-2.0",
    maintainer="billiards_sim maintainers",
    maintainer_email="maintainers@billiards-sim.example.org",
    python_requires=">=3.10",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={
        NAME: [
            "py.typed",
            *(f"study/{name}.json" for name in ("truth", "elastic", "pocket_first_event")),
            "ros/fastdds.xml",
            "play/page/*",
        ]
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", glob("config/*")),
        (f"share/{NAME}/launch", glob("launch/*.launch.py")),
    ],
    install_requires=["numpy"],
    extras_require={
        "ros": ROS,
        "fast": FAST,
        "plot": PLOT,
        "play": PLAY,
        "progress": PROGRESS,
        "gym": GYM,
        "test": [
            *ROS,
            *FAST,
            *PLOT,
            *PLAY,
            *GYM,
            "nbclient",
            "ipykernel",
            "playwright",  # drives Debian's Chromium, where that is installed
            "pytest",
            "pytest-xdist",
            "hypothesis",
            "rosbags",
            "distributed",  # Dask
            "scipy",
            "mpmath>=1.4",
            "ruff~=0.17.6",
            "mypy~=2.4",
            "types-PyYAML",
            "types-tqdm",
            "colcon-common-extensions",
            "colcon-ros",
            "setuptools<80",  # colcon's bound
        ],
        "peers": PEERS,
    },
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "table = billiards_sim.__main__:table",
            "shoot = billiards_sim.__main__:shoot",
            "demo = billiards_sim.__main__:demo",
            "simulate = billiards_sim.__main__:simulate",
            "plan = billiards_sim.__main__:plan",
            "play = billiards_sim.__main__:play",
            "benchmark = billiards_sim.__main__:benchmark",
        ],
    },
)
