"""Policies that are no machines: any object that acts or predicts, from Python or from a file of one's own."""

from __future__ import annotations

import importlib.util
import inspect
import re
import reprlib
import sys
from collections.abc import Callable, Iterable
from modulefinder import ModuleFinder
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tral_env.errors import ConfigError, PolicyError, nearest, reason
from tral_env.interface import CONTROL_PERIOD_S, Policy
from tral_fsm.policies import load_policy
from tral_fsm.runtime.policy import MachinePolicy

_SOURCE = re.compile(r"(?P<path>.+\.py)(?::(?P<name>.*))?")
_EXPECTED = "an object with act(observation) or predict(observation)"


class OwnPolicy:
    """Any object with `act(observation)` or `predict(observation)`, as a policy for one car.

    Its answers are checked, and its errors say which policy failed and when. What it has beside `act`, such as
    `active_states` and `wanted_clearance`, is passed on.
    """

    def __init__(self, own: object, name: str = "", file: str | None = None) -> None:
        """Take an object over.

        Args:
            own: the object. If it has both methods, `act` is called. A `reset` may take the number of cars.
            name: its name in errors; empty: that of its class.
            file: path of its code.

        Raises:
            ConfigError: it has no such method.
        """
        self._own, self._name, self._file = own, name or type(own).__name__, file
        self._act = _method(own, "act")
        self._predict = _method(own, "predict")
        if self._act is None and self._predict is None:
            raise ConfigError(f"policy {self._name}: got {_short(own)}: expected {_EXPECTED}")
        self._begin()

    def _begin(self) -> None:
        self._ticks, self._state = 0, None

    def reset(self, n: int = 1) -> None:
        """Start a new episode.

        Raises:
            ConfigError: there is more than one car.
            PolicyError: the object's own `reset` raised an error.
        """
        if n != 1:
            raise ConfigError(f"{self._name} drives one car, got {n}")
        self._begin()
        own = _method(self._own, "reset")
        try:
            if own is not None:
                own(*([n] if _takes(own, n) else []))
        except Exception as error:
            raise self._failed("at the reset", error) from error

    def act(self, observation: NDArray[np.floating]) -> NDArray[np.float32]:
        """Command for an observation (d,): (2,) steering, throttle.

        Raises:
            PolicyError: the object raised an error, or did not answer two finite numbers.
        """
        self._ticks += 1
        when = f"at {self._ticks * CONTROL_PERIOD_S:.2f} s"
        try:
            answer = self._answer(observation)
        except Exception as error:
            raise self._failed(when, error) from error
        try:
            command = np.asarray(answer, np.float32)
        except (TypeError, ValueError):
            command = np.zeros(0, np.float32)
        if command.shape == (1, 2):
            command = command[0]
        if command.shape != (2,) or not np.isfinite(command).all():
            expected = "expected two finite numbers: steering, throttle"
            failed = PolicyError(f"policy {self._name} answered {_short(answer)} {when}: {expected}")
            failed.why = f"answered {_short(answer)}: {expected}"
            raise failed
        return command

    def _answer(self, observation: NDArray[np.floating]) -> Any:
        """What the object answers; that of `predict` may be a pair with the state of a recurrent network."""
        if self._act is not None:
            return self._act(observation)
        assert self._predict is not None
        state = {"state": self._state, "episode_start": np.array([self._ticks == 1]), "deterministic": True}
        answer = self._predict(observation, **(state if _takes(self._predict, observation, **state) else {}))
        if isinstance(answer, tuple) and len(answer) == 2 and np.ndim(answer[0]) > 0:
            answer, self._state = answer
        return answer

    def _failed(self, when: str, error: Exception) -> PolicyError:
        """Word an error of the object; that of a machine within it names its place already."""
        if isinstance(error, PolicyError):
            return type(error)(f"policy {self._name}: {error}")
        why = reason(error, self._file)
        failed = PolicyError(f"policy {self._name} failed {when}: {why}")
        failed.why = why
        return failed

    @property
    def active_states(self) -> list[str]:
        """Names of the states of its car, as the object tells them; empty if it tells none.

        Raises:
            PolicyError: the object raised an error, or what it tells is no list of names.
        """
        states = self._told("active_states", ())
        if isinstance(states, str) or not isinstance(states, Iterable):
            raise PolicyError(
                f"policy {self._name}: active_states = {_short(states)}: expected a list with the name of the state"
            )
        return [str(state) for state in states]

    @property
    def wanted_clearance(self) -> NDArray[np.float64]:
        """(1, 2) side of the wall and clearance [m] that the object wants; NaN if it wants none.

        Raises:
            PolicyError: the object raised an error, or what it tells are not two numbers.
        """
        wanted = self._told("wanted_clearance", None)
        if wanted is None:
            return np.full((1, 2), np.nan)
        try:
            numbers = np.array(wanted, np.float64)
        except (TypeError, ValueError):
            numbers = np.zeros(0)
        if numbers.shape not in ((2,), (1, 2)):
            raise PolicyError(
                f"policy {self._name}: wanted_clearance = {_short(wanted)}: expected two numbers: +1 for the left or "
                "-1 for the right wall, and m; NaN for none"
            )
        return numbers.reshape(1, 2)

    def _told(self, name: str, default: Any) -> Any:
        """An attribute of the object, or the default if it has none; a property may fail."""
        try:
            return getattr(self._own, name)
        except Exception as error:
            if isinstance(error, AttributeError) and inspect.getattr_static(self._own, name, None) is None:
                return default
            raise self._failed(f"to tell its {name}", error) from error

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._own, name)


def as_policy(own: Any) -> MachinePolicy | OwnPolicy:
    """Any object that drives, as a policy for one car: a machine as it is, another one as `OwnPolicy`.

    Raises:
        ConfigError: it has neither `act` nor `predict`, or it is a class.
    """
    if isinstance(own, type):
        raise ConfigError(f"policy {own.__name__}: got the class: expected an object: {own.__name__}()")
    return own if isinstance(own, MachinePolicy | OwnPolicy) else OwnPolicy(own)


def find_policy(source: str) -> Policy:
    """The policy of a command line.

    Args:
        source: name of a packaged machine, path of a machine file, or FILE.py:NAME. There NAME is a policy, or a class
            or a function that makes one without arguments.

    Raises:
        ConfigError: the file cannot be opened, has no such name, or the name gives no policy.
        MachineError: no such machine, or it cannot run.
        PolicyError: the code of the file raised an error.
    """
    parts = _SOURCE.fullmatch(source)
    if parts is None:
        return load_policy(source)
    path, name = Path(parts["path"]), parts["name"]
    module = _module(path)
    names = _names_of_policies(module)
    if not name:
        raise ConfigError(f"policy {source}: expected FILE.py:NAME, such as {source}:{(names or ['MyPolicy'])[0]}")
    if name not in vars(module):
        raise ConfigError(f"policy {source}: {path.name} has no '{name}': {nearest(name, names)}")
    own, file = getattr(module, name), str(path.resolve())
    if isinstance(own, type) or not _drives(own):
        own = _made(source, own, file)
    return own if isinstance(own, MachinePolicy) else OwnPolicy(own, source, file)


def files_of(path: Path) -> list[Path]:
    """A file of Python, and all files of its folder that it imports, itself or through others.

    What it imports from elsewhere, and what it reads, are not among them.
    """
    folder = str(path.resolve().parent)
    finder = ModuleFinder(path=[folder])
    finder.run_script(str(path.resolve()))
    found = (getattr(one, "__file__", None) for one in finder.modules.values())
    return sorted({Path(file) for file in found if file})


class _Neighbours:
    """Folders of the files that were run; modules of one folder are not those of another one."""

    folders: ClassVar[set[str]] = set()

    @classmethod
    def enter(cls, folder: str) -> None:
        """Let a file import from its folder first, and forget modules of other folders that have the same names."""
        mine = {path.stem for path in Path(folder).iterdir() if path.suffix == ".py" or path.is_dir()}
        for name, module in list(sys.modules.items()):
            file = getattr(module, "__file__", None)
            top = name.partition(".")[0]
            if top in mine and file and cls._is_foreign(top, Path(file), folder):
                del sys.modules[name]
        cls.folders.add(folder)
        if folder in sys.path:
            sys.path.remove(folder)
        sys.path.insert(0, folder)

    @classmethod
    def _is_foreign(cls, name: str, file: Path, folder: str) -> bool:
        """Whether a module of a name comes from the folder of another policy."""
        if file == Path(folder, f"{name}.py") or Path(folder, name) in file.parents:
            return False
        return not cls.folders.isdisjoint(map(str, file.parents))


def _module(path: Path) -> ModuleType:
    """Run a file as a module; it may import its neighbours, as a script may."""
    if not path.is_file():
        raise ConfigError(f"Python file {path}: there is no such file")
    name = f"own_policy_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path.resolve())
    assert spec is not None, "a name that ends in .py has a loader"
    assert spec.loader is not None
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    _Neighbours.enter(str(path.resolve().parent))
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        hint = ": save it as UTF-8" if isinstance(error, SyntaxError) and "codec can't decode" in str(error) else ""
        raise PolicyError(f"Python file {path} cannot be loaded: {reason(error, str(path.resolve()))}{hint}") from error
    return module


def _made(source: str, make: Any, file: str) -> Any:
    """What a class or a function makes."""
    if not callable(make):
        raise ConfigError(
            f"policy {source}: got {_short(make)}: expected {_EXPECTED}, or a class or function that makes it"
        )
    if not _takes(make):
        raise ConfigError(
            f"policy {source}: it needs arguments: write a function without arguments that makes the policy"
        )
    try:
        return make()
    except Exception as error:
        raise PolicyError(f"policy {source} cannot be made: {reason(error, file)}") from error


def _names_of_policies(module: ModuleType) -> list[str]:
    """Names in a file that may be meant: what is defined there, and objects that drive."""
    return [
        name
        for name, value in vars(module).items()
        if not name.startswith("_")
        and not isinstance(value, ModuleType)
        and (getattr(value, "__module__", None) == module.__name__ or (_drives(value) and not isinstance(value, type)))
    ]


def _drives(own: object) -> bool:
    return _method(own, "act") is not None or _method(own, "predict") is not None


def _method(own: object, name: str) -> Callable[..., Any] | None:
    method = getattr(own, name, None)
    return method if callable(method) else None


def _takes(method: Callable[..., Any], *args: Any, **kwargs: Any) -> bool:
    """Whether a method can be called so; one that does not tell its parameters takes anything."""
    try:
        inspect.signature(method).bind(*args, **kwargs)
    except ValueError:
        return True
    except TypeError:
        return False
    return True


def _short(value: object) -> str:
    plain = type(value).__repr__ is object.__repr__  # its place in memory tells nobody anything
    return f"a {type(value).__name__}" if plain else reprlib.repr(value)
