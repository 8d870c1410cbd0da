"""A network learns from a machine: the network drives, the machine says at each decision what it would do.

So the network sees the states into which it brings the car itself, with the right answer beside each. Source: Ross,
Gordon and Bagnell, A Reduction of Imitation Learning and Structured Prediction to No-Regret Online Learning, 2011
(DAgger).
"""

from __future__ import annotations

import math
from concurrent.futures import Future, ThreadPoolExecutor

from tral_env.errors import ConfigError
from tral_env.learned import Network
from tral_env.vector_env import TralCorridorVectorEnv
from tral_fsm.learning.lessons import Lessons, chart_of
from tral_fsm.learning.networks import torch
from tral_fsm.learning.run import TrainingRun
from tral_fsm.learning.student import Samples, Student
from tral_fsm.learning.teacher_settings import TeacherSettings
from tral_fsm.policies import load_machine_policy

KEPT_ROUNDS = 30
"""A checkpoint holds the decisions of so many rounds, 40 MB with the packaged settings; all of them would be 250 MB."""


def train(run: TrainingRun) -> None:
    """Train until the time or the steps are used up. The best network is in the folder of the run then.

    While the cars drive, the network learns from the decisions of the rounds before, in a thread of its own.
    """
    request, settings = run.request, run.settings
    torch.set_num_threads(1)
    machine = load_machine_policy(request.machine_name)
    chart = chart_of(machine.definition, settings.learner) if settings.chart else None
    student = Student(settings, request.machine_name, chart, request.seed)
    samples = Samples(settings.samples, student.inputs)
    done = _resume(run, student, samples)
    env = TralCorridorVectorEnv(
        settings.cars,
        autoreset_mode="Disabled",
        nthread=request.nthread,
        scenario=request.scenario,
        randomization=request.levels,
    )
    lessons = Lessons(env, machine, settings, chart, request.first_seed(done))
    try:
        with ThreadPoolExecutor(1) as thread:
            _rounds(run, student, lessons, samples, thread, done)
    finally:
        env.close()


def _rounds(
    run: TrainingRun, student: Student, lessons: Lessons, samples: Samples, thread: ThreadPoolExecutor, done: int
) -> None:
    """Drive and learn, round by round; `done` were done before."""
    settings: TeacherSettings = run.settings
    reserve = settings.round_decisions * settings.cars
    ticks = settings.round_decisions * settings.learner.decision_ticks
    network, loss = student.network(), math.nan
    pending: Future[float] | None = None
    while not run.is_over:
        lessons.begin_round(max(1.0 - done / settings.teacher_rounds, 0.0))
        for tick in range(ticks):
            run.steps += lessons.tick(network, samples)
            if tick % 40 == 0:
                run.tell(lessons.success)
                if run.share >= 1.0:
                    break
        if pending is not None:
            loss, pending = pending.result(), None
            network = student.network()
        done += 1
        if run.is_validation_due or run.is_over:
            _validate(run, network, lessons, loss)
            run.keep(student.state() | {"rounds": done, "samples": samples.newest(KEPT_ROUNDS * reserve)})
        if samples.total:
            window = samples.window(2 * reserve)
            pending = thread.submit(student.learn, samples, window, settings.round_updates, run.share)
    if pending is not None:
        pending.result()


def _validate(run: TrainingRun, network: Network, lessons: Lessons, loss: float) -> None:
    """Drive the validation."""
    figures = {
        "success": lessons.success,
        "episodes": lessons.episodes,
        "loss": None if math.isnan(loss) else round(loss, 6),
    }
    run.validate(network, figures)


def _resume(run: TrainingRun, student: Student, samples: Samples) -> int:
    """Go on from the checkpoint, if the run does; gives the number of rounds that were done.

    Raises:
        ConfigError: the checkpoint is not one of this training.
    """
    state = run.kept()
    if state is None:
        return 0
    try:
        student.load(state)
        samples.add(*(state["samples"][name].numpy() for name in ("inputs", "answers", "states")))
        return int(state["rounds"])
    except (KeyError, RuntimeError, ValueError, TypeError, AttributeError) as error:
        raise ConfigError(f"--resume: the checkpoint does not fit: {error}") from error
