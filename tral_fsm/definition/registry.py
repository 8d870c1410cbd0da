"""The types that machine files may name: each has a spec, which is its data, and a class that runs the spec."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, ClassVar, Generic, TypeVar, get_args

from tral_env.errors import MachineError
from tral_fsm.definition.validated import Spec, type_name

T = TypeVar("T", bound=Spec)


class Runtime(Generic[T]):
    """Base of the classes that run a spec. `State[MySpec]` and `Condition[MySpec]` say which."""

    spec_type: ClassVar[type[Spec]]
    """The spec that this class runs, taken from the brackets behind its base."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        for base in cls.__dict__.get("__orig_bases__", ()):
            for argument in get_args(base):
                if isinstance(argument, type) and issubclass(argument, Spec):
                    cls.spec_type = argument

    def adopt(self, before: Runtime[T], after: Runtime[T]) -> None:
        """Go on with other parameters. What this object remembers of the drive stays.

        An attribute that still is as the old parameters made it becomes what the new ones make.

        Args:
            before: a new object with the parameters that this one has.
            after: a new object with the parameters that it shall have.
        """
        old = vars(before)
        for name, value in vars(after).items():
            if name in old and _same(getattr(self, name), old[name]):
                setattr(self, name, value)


def _same(one: Any, other: Any) -> bool:
    try:
        return one is other or bool(one == other)
    except ValueError:  # arrays
        return False


R = TypeVar("R", bound=type[Runtime[Any]])


class Registry(Mapping[str, type[T]]):
    """Type in machine files -> its spec. It starts empty; `register` fills it."""

    def __init__(self, base: type[T]) -> None:
        """Make an empty registry.

        Args:
            base: what every spec in it derives from.
        """
        self.base = base
        self._runtimes: dict[str, type[Any]] = {}

    def __getitem__(self, name: str) -> type[T]:
        spec: type[T] = self._runtimes[name].spec_type
        return spec

    def __iter__(self) -> Iterator[str]:
        return iter(self._runtimes)

    def __len__(self) -> int:
        return len(self._runtimes)

    def runtime(self, name: str) -> type[Any]:
        """The class that runs the spec of a type.

        Raises:
            KeyError: the type is not known.
        """
        return self._runtimes[name]

    def register_all(self, runtimes: Iterable[type[Runtime[Any]]]) -> None:
        """Register several classes, in the order of the schema and of all lists."""
        for runtime in runtimes:
            self.register(runtime)

    def unregister(self, name: str) -> None:
        """Let machine files no longer name a type. Nothing happens if the type is not known."""
        self._runtimes.pop(name, None)

    def register(self, runtime: R) -> R:
        """Let machine files name the type of a class from now on. It is also a decorator.

        Args:
            runtime: a class of states or conditions.

        Returns:
            The class, unchanged.

        Raises:
            MachineError: the class names no spec, its spec is of the wrong kind or has no type, another spec has its
                type already, or the class lacks a member that the spec asks for.
        """
        spec: type[Any] = runtime.spec_type
        if spec is self.base:
            name = runtime.__qualname__
            raise MachineError(
                f"{name} does not say which spec it runs: write the class of the spec in brackets "
                f"behind its base, such as {name}({runtime.__mro__[1].__name__}[{name}Spec])"
            )
        if not issubclass(spec, self.base):
            raise MachineError(f"{runtime.__qualname__} runs {spec.__qualname__}, which is no {self.base.__name__}")
        name = type_name(spec)
        taken = self.get(name, spec)
        if (taken.__module__, taken.__qualname__) != (spec.__module__, spec.__qualname__):
            raise MachineError(
                f"{spec.__module__}.{spec.__qualname__} calls itself {name!r}, which {taken.__module__}."
                f"{taken.__qualname__} does already: choose another type"
            )
        for member, word in spec.required_members().items():
            if not hasattr(runtime, member):
                raise MachineError(
                    f"{spec.__qualname__} says that it is {word}, but {runtime.__qualname__} has no {member!r}: "
                    f"define {member!r} in the class"
                )
        self._runtimes[name] = runtime
        return runtime
