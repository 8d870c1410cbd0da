"""Contenders of a comparison behind one interface: machines, policy files, Python policies, and built-in ones.

A contender is one or more trained agents: those of the same training with other seeds are one contender.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from tral_env.errors import ConfigError, nearest
from tral_env.interface import CONTROL_RATE_HZ, Policy
from tral_env.policy_file import JSON_NAME, load_network
from tral_env.world import World
from tral_fsm.definition import packaged
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.evaluation.baselines import BASELINES
from tral_fsm.evaluation.choices import listed
from tral_fsm.evaluation.effort import Effort, of_file, of_policy
from tral_fsm.evaluation.own_policy import files_of, find_policy
from tral_fsm.evaluation.records import digest
from tral_fsm.evaluation.row_policies import BatchedPolicy, DriverPool, RowPolicies, SinglePolicies
from tral_fsm.evaluation.specialists import Specialists, machines_of_families
from tral_fsm.policies import load_policy, trained
from tral_fsm.policies.families import machine_for
from tral_fsm.runtime.policy import MachinePolicy

ALIASES = {"ramp": "gate"}
"""Other names of packaged machines: `gate` is the manoeuvre of 2016, a ramp before each gate."""
SPECIALISTS = "specialists"
"""The contender that drives each family with the packaged machine that is made for it."""
_NAMED = re.compile(r"(?P<name>[^=/\\]+)=(?P<sources>.*)")
_WORD = re.compile(r"[\w-]{1,60}")
_PYTHON = re.compile(r".+\.py(:.*)?")


@dataclass(frozen=True, kw_only=True)
class Agent:
    """What drives: one machine, one trained network, one policy."""

    source: str
    """Name or path, as it was given."""
    kind: str
    """"machine", "policy file", "python", "object" or "built-in"."""
    digest: str
    """Digest of its content, 16 hexadecimal digits; empty for a built-in one."""
    sees_truth: bool = False
    """Whether it knows what no policy may know."""
    provenance: dict[str, Any] = field(default_factory=dict)
    """What it tells of its making."""
    effort: Effort | None = None
    """What was spent to prepare it; None: nothing had to be prepared."""
    decision_hz: float = CONTROL_RATE_HZ
    """How often it may choose another command."""
    policy: Any = field(default=None, repr=False, compare=False)
    """The policy of an "object", which drives in this process alone."""

    def record(self) -> dict[str, Any]:
        """The agent for JSON."""
        plain = {one.name: getattr(self, one.name) for one in fields(self) if one.name != "policy"}
        return plain | {"effort": None if self.effort is None else self.effort.record()}


@dataclass(frozen=True, kw_only=True)
class Contender:
    """One entry of a comparison."""

    name: str
    agents: tuple[Agent, ...]

    def __post_init__(self) -> None:
        """Check that the records can tell the agents from one another.

        Raises:
            ConfigError: there is no agent, two have the same source, or the name has a sign that tables need or no
                file can hold.
        """
        halves = any("\ud800" <= sign <= "\udfff" for sign in self.name)
        if set(self.name) & set("|\n") or halves or not self.name.strip():
            raise ConfigError(f"contender {self.name!r}: expected a name in one line, without |")
        sources = [one.source for one in self.agents]
        if not sources:
            raise ConfigError(f"contender {self.name}: got no agent: expected at least one")
        for source in sources:
            if sources.count(source) > 1:
                raise ConfigError(
                    f"contender {self.name}: two agents are called '{source}': expected a source of its own for each"
                )

    def record(self) -> dict[str, Any]:
        """The contender for JSON."""
        return {"name": self.name, "agents": [agent.record() for agent in self.agents]}


def contenders(text: str) -> list[Contender]:
    """Contenders of a text: entries that commas separate.

    Args:
        text: an entry is a SOURCE, NAME=SOURCE, or NAME=SOURCE+SOURCE for agents of one training with other seeds. A
            source is the name of a packaged machine or of `BASELINES`, a machine file, a policy file, or FILE.py:NAME.

    Raises:
        ConfigError: there is no entry, or two have the same name.
        TralError: a source cannot be read.
    """
    found = [contender(entry) for entry in listed(text)]
    if not found:
        raise ConfigError("--policies: got no policy: expected names or files, such as office,pursuit,constant")
    require_different_names(found)
    return found


def require_different_names(field: Sequence[Contender]) -> None:
    """Refuse contenders that their records could not tell apart.

    Raises:
        ConfigError: two have the same name.
    """
    names = [one.name for one in field]
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(f"--policies: two are called '{name}': name one of them, such as other={name}")


def contender(entry: str) -> Contender:
    """The contender of one entry, see `contenders`."""
    named = _NAMED.fullmatch(entry)
    sources = [source.strip() for source in named["sources"].split("+")] if named else [entry]
    if not all(sources):
        raise ConfigError(f"--policies {entry}: a source is empty: expected NAME=SOURCE or NAME=SOURCE+SOURCE")
    agents = tuple(agent(source) for source in sources)
    seen = {(one.kind, one.digest or one.source) for one in agents}
    if len(seen) < len(agents):
        raise ConfigError(f"--policies {entry}: two agents are the same: expected one for each training seed")
    return Contender(name=named["name"].strip() if named else _name_of(entry), agents=agents)


def _name_of(source: str) -> str:
    """Short name of a source: `policy.json` has that of its folder."""
    if source in built_in_names():
        return source
    path, _, name = source.partition(".py:")
    if name:
        return name
    stem = Path(path).stem
    return Path(path).resolve().parent.name if stem in ("policy", "machine") else stem


def built_in_names() -> list[str]:
    """Names that need no file."""
    return [*packaged.names(), *trained.names(), *BASELINES, *ALIASES, SPECIALISTS]


def agent(source: str) -> Agent:
    """The agent of a source, checked by loading it.

    Raises:
        TralError: it cannot be loaded.
    """
    if source in BASELINES:
        baseline = BASELINES[source]
        return Agent(
            source=source,
            kind="built-in",
            digest="",
            sees_truth=baseline.sees_truth,
            provenance={"meaning": baseline.meaning},
            decision_hz=baseline.decision_hz,
        )
    if _PYTHON.fullmatch(source):
        effort = of_file(_python_file(source))
        return Agent(source=source, kind="python", digest=_digest(source, find_policy(source)), effort=effort)
    if source == SPECIALISTS:
        machines = machines_of_families()
        told = {"machines": ", ".join(one.name for one in machines.values())}
        return Agent(
            source=source, kind="machine", digest=_joint_digest(machines.values()), provenance=told, effort=Effort()
        )
    names = built_in_names()
    if source not in names and _WORD.fullmatch(source) and not Path(source).exists():
        raise ConfigError(
            f"--policies {source}: no such name, file, or folder of a trained policy: {nearest(source, names)}"
        )
    policy = load_policy(ALIASES.get(source, source))
    if isinstance(policy, MachinePolicy):
        told = {"machine": policy.definition.name or source}
        effort = Effort() if source in names else of_file(Path(source))
        return Agent(source=source, kind="machine", digest=_digest(source, policy), provenance=told, effort=effort)
    return _trained(source, policy)


def _trained(source: str, policy: Policy) -> Agent:
    """The agent of a trained policy; one that corrects a machine may change its command whenever that does."""
    path = Path(trained.path_of(source))
    network = load_network(path)
    return Agent(
        source=source,
        kind="policy file",
        digest=_digest(source, policy),
        provenance=dict(network.provenance),
        effort=of_policy(path, network),
        decision_hz=network.learner.decision_hz if network.correction is None else CONTROL_RATE_HZ,
    )


def _python_file(source: str) -> Path:
    """File of a source FILE.py or FILE.py:NAME."""
    return Path(source.partition(".py:")[0].removesuffix(".py") + ".py")


def _digest(source: str, policy: Any) -> str:
    """Digest of the content of a source that gave a policy: of a machine, a policy file, or Python code."""
    if _PYTHON.fullmatch(source):
        return file_digest(*files_of(_python_file(source)))
    if isinstance(policy, MachinePolicy):
        return digest(policy.definition)
    path = Path(trained.path_of(source))
    return file_digest(path / JSON_NAME if path.is_dir() else path)  # it tells the digest of the weights


def _joint_digest(machines: Iterable[MachineDefinition]) -> str:
    """Digest of several machines, 16 hexadecimal digits."""
    return hashlib.sha256(" ".join(map(digest, machines)).encode()).hexdigest()[:16]


def object_agent(source: str, policy: Any, digest: str, effort: Effort | None = None, **provenance: Any) -> Agent:
    """An agent that was made in this program.

    Args:
        source: its name in the records.
        policy: acts on (n, d), and starts single rows again with `reset_rows(rows)`.
        digest: tells it from others; what was driven with another one is not mixed in.
        effort: what was spent to prepare it; None: it is unknown.
        provenance: what the page tells of its making.
    """
    effort = effort or Effort()
    return Agent(source=source, kind="object", digest=digest, provenance=provenance, effort=effort, policy=policy)


def file_digest(*paths: Path) -> str:
    """Digest of the content of files, 16 hexadecimal digits."""
    content = hashlib.sha256()
    for path in paths:
        content.update(path.read_bytes())
    return content.hexdigest()[:16]


def single_policy(who: Agent, family: str) -> Policy | None:
    """The policy of an agent for one car in an environment; None: it has none.

    Args:
        who: the agent.
        family: family of the course, which decides what drives of the specialists.

    Raises:
        ConfigError: the content of its source is no longer what the agent's digest tells.
    """
    if who.kind in ("built-in", "object"):
        return None
    return load_policy(machine_for([family])) if who.source == SPECIALISTS else _policy(who)


def _policy(who: Agent) -> Policy:
    """The policy of the source of an agent.

    Raises:
        ConfigError: as `single_policy`.
    """
    policy = find_policy(ALIASES.get(who.source, who.source))
    if _digest(who.source, policy) != who.digest:
        raise ConfigError(
            f"{who.source} has changed since the comparison began: choose another --out, and compare a file that no "
            "training and no search writes"
        )
    return policy


def row_policies(who: Agent, world: World) -> RowPolicies:
    """The policies of the rows of a world, for an agent.

    Raises:
        ConfigError: as `single_policy`.
    """
    if who.kind == "built-in":
        return BASELINES[who.source].make(world)
    if who.kind == "object":
        return BatchedPolicy(who.policy, world.n, who.source)
    if who.source == SPECIALISTS:
        return Specialists(world.n)
    if who.kind == "python":
        return SinglePolicies(lambda: _policy(who), world.n)
    policy = _policy(who)
    if isinstance(policy, MachinePolicy):
        return DriverPool([policy.definition], world.n)
    return BatchedPolicy(policy, world.n, who.source)
