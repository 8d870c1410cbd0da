"""Contenders of a comparison behind one interface: machines, policy files, Python policies, and built-in ones.

A contender is one or more trained agents: those of the same training with other seeds are one contender.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from tral_env.errors import ConfigError
from tral_env.interface import Policy
from tral_env.policy_file import JSON_NAME, load_network
from tral_env.world import World
from tral_fsm.definition import packaged
from tral_fsm.evaluation.baselines import BASELINES
from tral_fsm.evaluation.choices import listed
from tral_fsm.evaluation.own_policy import find_policy
from tral_fsm.evaluation.records import digest
from tral_fsm.evaluation.row_policies import BatchedPolicy, DriverPool, RowPolicies, SinglePolicies
from tral_fsm.policies import load_policy
from tral_fsm.runtime.policy import MachinePolicy

ALIASES = {"ramp": "gate"}
"""Other names of packaged machines: `gate` is the manoeuvre of 2016, a ramp before each gate."""
_NAMED = re.compile(r"(?P<name>[^=/\\]+)=(?P<sources>.+)")
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
    policy: Any = field(default=None, repr=False, compare=False)
    """The policy of an "object", which drives in this process alone."""

    def record(self) -> dict[str, Any]:
        """The agent for JSON."""
        return {one.name: getattr(self, one.name) for one in fields(self) if one.name != "policy"}


@dataclass(frozen=True, kw_only=True)
class Contender:
    """One entry of a comparison."""

    name: str
    agents: tuple[Agent, ...]

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
    names = [one.name for one in found]
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(f"--policies: two are called '{name}': name one of them, such as other={name}")
    return found


def contender(entry: str) -> Contender:
    """The contender of one entry, see `contenders`."""
    named = _NAMED.fullmatch(entry)
    sources = named["sources"].split("+") if named else [entry]
    agents = tuple(agent(source.strip()) for source in sources)
    seen = {(one.kind, one.digest) for one in agents}
    if len(seen) < len(agents):
        raise ConfigError(f"--policies {entry}: two agents are the same: expected one for each training seed")
    return Contender(name=named["name"].strip() if named else _name_of(entry), agents=agents)


def _name_of(source: str) -> str:
    """Short name of a source: `policy.json` has that of its folder."""
    if source in BASELINES or source in ALIASES or source in packaged.names():
        return source
    path, _, name = source.partition(".py:")
    if name:
        return name
    stem = Path(path).stem
    return Path(path).resolve().parent.name if stem in ("policy", "machine") else stem


def agent(source: str) -> Agent:
    """The agent of a source, checked by loading it.

    Raises:
        TralError: it cannot be loaded.
    """
    if source in BASELINES:
        baseline = BASELINES[source]
        told = {"meaning": baseline.meaning}
        return Agent(source=source, kind="built-in", digest="", sees_truth=baseline.sees_truth, provenance=told)
    if _PYTHON.fullmatch(source):
        find_policy(source)
        return Agent(source=source, kind="python", digest=file_digest(Path(source.partition(".py:")[0] + ".py")))
    policy = load_policy(ALIASES.get(source, source))
    if isinstance(policy, MachinePolicy):
        told = {"machine": policy.definition.name or source}
        return Agent(source=source, kind="machine", digest=digest(policy.definition), provenance=told)
    path = Path(source)
    about = path / JSON_NAME if path.is_dir() else path  # it tells the digest of the weights
    told = dict(load_network(source).provenance)
    return Agent(source=source, kind="policy file", digest=file_digest(about), provenance=told)


def object_agent(source: str, policy: Any, digest: str, **provenance: Any) -> Agent:
    """An agent that was made in this program.

    Args:
        source: its name in the records.
        policy: acts on (n, d), and starts single rows again with `reset_rows(rows)`.
        digest: tells it from others; what was driven with another one is not mixed in.
        provenance: what the page tells of its making.
    """
    return Agent(source=source, kind="object", digest=digest, provenance=provenance, policy=policy)


def file_digest(path: Path) -> str:
    """Digest of the content of a file, 16 hexadecimal digits."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def single_policy(who: Agent) -> Policy | None:
    """The policy of an agent for one car in an environment; None: it has none."""
    if who.kind in ("built-in", "object"):
        return None
    return find_policy(ALIASES.get(who.source, who.source))


def row_policies(who: Agent, world: World) -> RowPolicies:
    """The policies of the rows of a world, for an agent."""
    if who.kind == "built-in":
        return BASELINES[who.source].make(world)
    if who.kind == "python":
        return SinglePolicies(lambda: find_policy(who.source), world.n)
    if who.kind == "object":
        return BatchedPolicy(who.policy, world.n)
    policy = load_policy(ALIASES.get(who.source, who.source))
    if isinstance(policy, MachinePolicy):
        return DriverPool([policy.definition], world.n)
    return BatchedPolicy(policy, world.n)
