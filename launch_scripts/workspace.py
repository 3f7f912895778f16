"""Where everything of this workspace is, what of it is out of date, and the environment it needs.

What each step of the set-up made is vouched for by a stamp inside of it, which holds the
fingerprint of what it was made from: delete what was made, and the stamp is gone too.
"""

import hashlib
import os
import platform
import shlex
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

ROS_DISTRIBUTION = "jazzy"
MESSAGES = "impact_rig_msgs"
NODES = "impact_rig"
LIBRARIES = ("scientific", "rig", "formats", "devices", "test")
"""Requirement files beside those of ROS 2 and of what installs and builds."""
BOOTSTRAP_DONE = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"
"""Tells the ROS wheels that the library path is right; else each Python starts itself twice."""
UNSET = ("PYTHONHOME", "PYTHONDONTWRITEBYTECODE")
"""A foreign Python's home; and what lets every process compile numpy and scipy again: 2 s."""


class SetupError(Exception):
    """The workspace cannot be set up; the text says why and what to do, in a sentence."""


@dataclass(frozen=True)
class Workspace:
    """A copy of the rig's repository and the ROS 2 it uses.

    Attributes
    ----------
    root : Path
        The folder with `setup.py`.
    is_ros_installed : bool
        Whether a sourced ROS 2 Jazzy is used, and not wheels.
    """

    root: Path
    is_ros_installed: bool

    @property
    def venv(self) -> Path:
        """The Python environment."""
        return self.root / ".venv"

    @property
    def python(self) -> Path:
        """The interpreter of the Python environment."""
        return self.venv / "bin" / "python3"

    @property
    def site_packages(self) -> Path:
        """Where pip installs."""
        return self.venv / _SITE_PACKAGES

    def get_prefix(self, package: str) -> Path:
        """Return where colcon installs a package."""
        return self.root / "install" / package

    @property
    def shell_environment(self) -> Path:
        """What a shell reads to get the environment of `make_environment`."""
        return self.get_prefix(NODES) / "environment.sh"

    def get_requirements(self, *names: str) -> list[Path]:
        """Return the files of these names: what is installed, with the hashes of its files."""
        folder = self.root / "launch_scripts" / "requirements" / "locked"
        return [folder / f"{name}.txt" for name in names]

    @property
    def build_requirements(self) -> list[Path]:
        """ROS 2 and what builds packages with it; the first comes with an installed ROS 2."""
        return self.get_requirements(*(() if self.is_ros_installed else ("ros",)), "colcon")

    @cached_property
    def steps(self) -> dict[str, "Step"]:
        """What must have been made, in this order."""
        scripts = self.root / "launch_scripts"
        place = sys.base_prefix, sys.version, str(self.root), str(self.is_ros_installed)
        python = self._fingerprint(self.get_requirements("installer"), *place)
        build = self._fingerprint(self.build_requirements, python)
        packages = self._fingerprint(self.get_requirements(*LIBRARIES), build)
        definitions = (self.root / "msg_config").rglob("*")
        messages = self._fingerprint((it for it in definitions if it.suffix != ".md"), build)
        nodes = [
            self.root / "setup.py",
            self.root / "package.xml",
            scripts / "impact-rig",
            *scripts.glob("*.launch.py"),
            *scripts.glob("resource/*"),
        ]
        return {
            "python": Step(self.venv / ".stamp-python", python),
            "packages": Step(self.venv / ".stamp-packages", packages),
            "messages": Step(self.get_prefix(MESSAGES) / ".stamp", messages),
            "nodes": Step(self.get_prefix(NODES) / ".stamp", self._fingerprint(nodes, build)),
        }

    def _fingerprint(self, paths: Iterable[Path], *others: str) -> str:
        """Return a hash of names and contents of files, and of other texts."""
        digest = hashlib.sha256("\0".join(others).encode())
        for path in sorted(path for path in paths if path.is_file()):
            content = path.read_bytes()
            digest.update(f"\0{path.relative_to(self.root)}\0{len(content)}\0".encode())
            digest.update(content)
        return digest.hexdigest()


@dataclass(frozen=True)
class Step:
    """Something that is made once, and again when what it is made from has changed.

    Attributes
    ----------
    stamp : Path
        File written when it has been made.
    fingerprint : str
        Of all that it is made from.
    """

    stamp: Path
    fingerprint: str

    def is_fresh(self) -> bool:
        """Return whether it has been made from what is there now."""
        try:
            return self.stamp.read_text("ascii") == self.fingerprint
        except OSError:
            return False


def find_workspace() -> Workspace:
    """Return the workspace this file belongs to.

    Raises
    ------
    SetupError
        If this machine or the ROS 2 that is sourced cannot be used.
    """
    root = Path(__file__).resolve().parent.parent
    distribution = os.environ.get("ROS_DISTRO", "")
    if distribution not in {"", ROS_DISTRIBUTION}:
        raise SetupError(
            f"ROS 2 {distribution} is sourced in this terminal and the rig needs Jazzy: source "
            "/opt/ros/jazzy/setup.bash, or use a terminal without ROS 2 (Jazzy then comes as "
            "Python wheels)."
        )
    problem = find_wheel_problem()
    if not distribution and problem:
        raise SetupError(problem)
    return Workspace(root, is_ros_installed=bool(distribution))


def find_wheel_problem() -> str:
    """Return why ROS 2 cannot come as wheels to this machine, or an empty text."""
    machine = f"{platform.system()} {platform.machine()}"
    if machine == "Linux x86_64":
        return ""
    return (
        f"ROS 2 Jazzy comes as Python wheels for Linux x86_64 only, and this is {machine}: "
        "source an installation of ROS 2 Jazzy first."
    )


def find_stale(workspace: Workspace) -> list[str]:
    """Return the names of the steps that must be run, in order."""
    stale = [name for name, step in workspace.steps.items() if not step.is_fresh()]
    if "python" in stale and "packages" not in stale:
        stale.insert(1, "packages")
    return stale


def make_environment(workspace: Workspace, base: Mapping[str, str]) -> dict[str, str]:
    """Return the environment in which nodes, command line and tests run.

    Parameters
    ----------
    workspace : Workspace
        Set up; with an installed ROS 2, whose environment `base` has.
    base : mapping
        Environment variables to start from.
    """
    messages, nodes = workspace.get_prefix(MESSAGES), workspace.get_prefix(NODES)
    environment = dict(base)
    environment["VIRTUAL_ENV"] = str(workspace.venv)
    for variable in UNSET:
        environment.pop(variable, None)

    def prepend(variable: str, *paths: Path) -> None:
        ours = [str(path) for path in paths]
        others = [part for part in environment.get(variable, "").split(os.pathsep) if part]
        environment[variable] = os.pathsep.join(dict.fromkeys(ours + others))

    prepend("PATH", nodes / "bin", workspace.venv / "bin")
    prepend("PYTHONPATH", workspace.root / "build" / NODES, messages / _SITE_PACKAGES)
    if workspace.is_ros_installed:
        prepend("AMENT_PREFIX_PATH", nodes, messages)
        prepend("LD_LIBRARY_PATH", messages / "lib")
    else:
        bundled = sorted(workspace.site_packages.glob("ros_*.libs"))
        environment["AMENT_PREFIX_PATH"] = environment["CMAKE_PREFIX_PATH"] = ""
        prepend("AMENT_PREFIX_PATH", nodes, messages, workspace.venv)
        prepend("CMAKE_PREFIX_PATH", messages, workspace.venv)
        prepend("LD_LIBRARY_PATH", messages / "lib", workspace.venv / "lib", *bundled)
        environment[BOOTSTRAP_DONE] = "1"
    return environment


def format_environment(workspace: Workspace) -> str:
    """Return the commands by which a shell gets the environment of `make_environment`."""
    extended = {"PATH", "PYTHONPATH", "LD_LIBRARY_PATH"}
    if workspace.is_ros_installed:
        extended.add("AMENT_PREFIX_PATH")
    lines = [f"unset {' '.join(UNSET)}"]
    for name, value in make_environment(workspace, {}).items():
        others = f"${{{name}:+:${name}}}" if name in extended else ""
        lines.append(f"{name}={shlex.quote(value)}{others}; export {name}")
    return "\n".join(lines) + "\n"


_SITE_PACKAGES = Path("lib", f"python{sys.version_info[0]}.{sys.version_info[1]}", "site-packages")
