"""Drives a share of the rows of `TralCorridorProcesses`: standard input brings requests, standard output takes answers.

A message is the length of a pickle and the pickle: a request, (name, arguments), or an answer, (whether it went well,
answer or exception). The process ends with its input, so also when the process that asks ends, however it does.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
from contextlib import suppress
from typing import IO, Any

from tral_env.errors import ConfigError, TralError

_LENGTH_BYTES = 8


def packed(message: object) -> bytes:
    """The pickle of a message."""
    return pickle.dumps(message, pickle.HIGHEST_PROTOCOL)


def send(stream: IO[bytes], content: bytes) -> None:
    """Write a message, which is `packed`.

    Raises:
        OSError: nobody reads it.
    """
    stream.write(len(content).to_bytes(_LENGTH_BYTES, "little"))
    stream.write(content)
    stream.flush()


def receive(stream: IO[bytes]) -> bytes:
    """Read the pickle of a message.

    Raises:
        EOFError: the stream has ended.
    """
    length = int.from_bytes(_read(stream, _LENGTH_BYTES), "little")
    return _read(stream, length)


def _read(stream: IO[bytes], length: int) -> bytes:
    content = stream.read(length)
    if len(content) < length:
        raise EOFError
    return content


def serve(requests: IO[bytes], answers: IO[bytes]) -> None:
    """Answer until the requests end."""
    env: Any = None
    while True:
        try:
            request = receive(requests)
        except EOFError:
            break
        try:
            name, arguments = _unpacked(request)
            if name == "make":
                from tral_env.vector_env import TralCorridorVectorEnv

                rows, options = arguments
                env = TralCorridorVectorEnv(rows, **options)
                answer: object = _about(env)
            elif name == "reset":
                seed, options = arguments
                answer = env.reset(seed=seed, options=options)
            else:
                answer = getattr(env, name)(*arguments)
            told: tuple[bool, object] = True, answer
        except Exception as error:
            told = False, _portable(error)
        try:
            send(answers, packed(told))
        except OSError:  # nobody waits for it: the environment was closed in the middle of a step
            break
    if env is not None:
        env.close()


def _unpacked(request: bytes) -> Any:
    try:
        return pickle.loads(request)
    except AttributeError as error:
        raise ConfigError(
            f"a process cannot make what it was given: {error}: move the class from the script to a module beside it"
        ) from error


def _about(env: Any) -> dict[str, Any]:
    return {
        "metadata": env.metadata,
        "render_mode": env.render_mode,
        "provided_readings": env.provided_readings,
        "learner_options": env.learner_options,
        "spaces": (env.single_observation_space, env.single_action_space),
    }


def _portable(error: Exception) -> Exception:
    """An exception that the other process can read."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return TralError(f"{type(error).__name__}: {error}")
    return error


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that asks
    with suppress(OSError), os.fdopen(os.dup(sys.stdout.fileno()), "wb") as told:
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what anything prints must not stand among the answers
        serve(sys.stdin.buffer, told)
