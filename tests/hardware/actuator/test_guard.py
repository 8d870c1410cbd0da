"""Which pulses may stand: arming, limits, silence, evidence, latches. Nothing here sleeps."""

import math
import random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rig import MS, NEUTRAL, OFF, STEERING, THROTTLE, Bench, settings

from tral_env.hardware.actuator.wire import CommandPacket, Flag, Reason, Refusal, State, pack, pack_reply, read_reply

HALF = (1530.0, 1300.0)
"""Pulses of throttle 0.5, straight."""


def test_neutral_comes_first_and_ends_after_half_a_second_without_commands() -> None:
    bench = Bench()
    assert bench.wait(490) == NEUTRAL
    assert bench.wait(10) == OFF
    assert bench.guard.state is State.DISARMED


def test_neutral_stands_as_long_as_commands_come() -> None:
    bench = Bench()
    assert bench.drive(2000, 0.0) == NEUTRAL


def test_no_throttle_goes_through_before_arming() -> None:
    assert Bench().drive(1000, 0.5) == NEUTRAL


def test_an_armed_car_drives() -> None:
    assert Bench().arm().drive(100, 0.5) == HALF


def test_arming_waits_until_neutral_has_stood() -> None:
    bench = Bench(settings(arming_s=1.0))
    bench.write()
    for _ in range(79):
        bench.wait(12.5)
        bench.send(flags=Flag.ARM)
    assert bench.guard.state is State.DISARMED
    bench.wait(12.5)
    bench.send(flags=Flag.ARM)
    assert bench.guard.state is State.ARMED


def test_neutral_that_the_board_did_not_take_does_not_count() -> None:
    bench = Bench(settings(arming_s=0.1))
    bench.board_takes = False
    for _ in range(20):
        bench.wait(12.5)
        bench.send(flags=Flag.ARM)
    assert bench.guard.state is State.DISARMED


def test_pulses_that_ended_make_neutral_stand_anew() -> None:
    bench = Bench(settings(arming_s=0.2))
    assert bench.wait(1000) == OFF
    assert bench.send(flags=Flag.ARM) == NEUTRAL
    assert bench.guard.state is State.DISARMED
    bench.wait(190)
    bench.send(flags=Flag.ARM)
    assert bench.guard.state is State.DISARMED
    bench.wait(10)
    bench.send(flags=Flag.ARM)
    assert bench.guard.state is State.ARMED


def test_arming_after_a_disarm_sends_neutral_until_a_command_comes() -> None:
    bench = Bench().arm()
    bench.drive(100, 0.5, steering=0.5)
    bench.send(flags=Flag.DISARM)
    bench.arm()
    assert bench.wait(90) == NEUTRAL


def test_arming_after_a_brake_sends_neutral_until_a_command_comes() -> None:
    bench = Bench(settings(brake=-1.0)).arm()
    bench.drive(100, 0.5)
    assert bench.send(flags=Flag.STOP) == BRAKE
    bench.send(flags=Flag.ARM)
    bench.arm()
    assert bench.wait(90) == NEUTRAL


def test_arming_with_throttle_is_no_arming() -> None:
    bench = Bench()
    bench.write()
    bench.send(0.1, flags=Flag.ARM)
    assert bench.guard.state is State.DISARMED


def test_a_command_beyond_the_bounds_counts_as_the_bound() -> None:
    bench = Bench().arm()
    assert bench.drive(12.5, 7.0, steering=-9.0) == (1810.0, 1100.0)
    assert (bench.reply.steering, bench.reply.throttle) == (-1.0, 1.0)
    bench.drive(12.5, -7.0, steering=9.0)
    assert (bench.reply.steering, bench.reply.throttle) == (1.0, -1.0)


def test_throttle_is_held_below_its_limits() -> None:
    bench = Bench(settings(max_throttle=0.25, max_reverse=0.125)).arm()
    assert bench.drive(100, 1.0) == (1530.0, 1400.0)
    assert bench.drive(100, -1.0) == (1530.0, 1550.0)


def test_slew_is_limited_by_the_time_that_passed_and_never_delays_neutral() -> None:
    slow = settings(STEERING._replace(slew_per_s=8.0), THROTTLE._replace(slew_per_s=4.0))
    bench = Bench(slow).arm()
    bench.drive(12.5, 1.0, steering=1.0)
    assert bench.reply[5:7] == pytest.approx((0.1, 0.05))
    bench.drive(25, 1.0, steering=1.0)
    assert bench.reply[5:7] == pytest.approx((0.3, 0.15))
    bench.drive(12.5, 0.0, steering=1.0)
    assert bench.reply[5:7] == pytest.approx((0.4, 0.0))
    bench.drive(12.5, 0.0, steering=0.0)
    assert bench.reply[5:7] == pytest.approx((0.3, 0.0))


def test_a_gap_earns_no_jump() -> None:
    bench = Bench(settings(STEERING._replace(slew_per_s=8.0))).arm()
    bench.wait(90)
    bench.send(steering=1.0)
    assert bench.reply.steering == pytest.approx(0.2)


def test_silence_ends_in_neutral_after_100_ms_and_in_no_pulses_after_500() -> None:
    bench = Bench().arm()
    bench.drive(100, 0.5)
    assert bench.wait(90) == HALF
    assert bench.wait(10) == NEUTRAL
    assert bench.guard.state is State.ARMED
    assert bench.wait(390) == NEUTRAL
    assert bench.wait(10) == OFF
    assert (bench.guard.state, bench.guard.reason) == (State.LATCHED, Reason.SILENCE)
    assert bench.reply.silences == 1


def test_a_short_silence_is_forgiven() -> None:
    bench = Bench().arm()
    bench.drive(100, 0.5)
    bench.wait(300)
    assert bench.send(0.5) == HALF
    bench.wait(150)
    assert (bench.guard.state, bench.reply.silences) == (State.ARMED, 2)


def test_a_worker_that_looks_late_still_ends_the_pulses() -> None:
    bench = Bench().arm()
    bench.drive(100, 0.5)
    bench.now_ns += 600 * MS
    assert bench.write() == OFF


@pytest.mark.parametrize(
    "changes",
    [
        {"throttle": math.nan},
        {"sequence": 0},
        {"stamp_ns": 0},
        {"stamp_ns": 2**62},
        {"evidence": 0},
        {"source": 1},
    ],
    ids=["nan", "repeated", "old", "future", "evidence", "source"],
)
def test_refused_commands_are_silence(changes: dict[str, Any]) -> None:
    bench = Bench().arm()
    bench.drive(100, 0.5)
    for _ in range(10):
        bench.wait(9)
        bench.send(**{"throttle": 0.5} | changes)
    assert bench.wait(10) == NEUTRAL
    assert bench.reply.refused == 10
    assert bench.reply.refusal is not Refusal.NONE


def test_another_source_takes_over_only_by_arming() -> None:
    bench = Bench().arm()
    bench.drive(100, 0.5)
    for _ in range(60):
        bench.wait(10)
        pulses = bench.send(0.5, source=1)
    assert (pulses, bench.reply.refusal) == (OFF, Refusal.NONE), "latched: refused no more, and not followed either"
    assert bench.guard.state is State.LATCHED
    bench.send(flags=Flag.ARM, source=1)
    bench.send(flags=Flag.ARM, source=1)
    assert bench.guard.state is State.ARMED
    assert bench.send(0.5, source=1) == HALF


def test_a_loop_that_lives_while_its_observations_are_frozen_is_stopped() -> None:
    bench = Bench(settings(evidence_s=1.0)).arm()
    bench.drive(100, 0.5)
    assert bench.drive(1000, 0.5, seeing=False) == HALF
    assert bench.drive(12.5, 0.5, seeing=False) == NEUTRAL
    assert (bench.guard.state, bench.guard.reason) == (State.LATCHED, Reason.EVIDENCE)


def test_one_observation_that_changed_feeds_for_another_second() -> None:
    bench = Bench(settings(evidence_s=1.0)).arm()
    for _ in range(5):
        bench.drive(12.5, 0.5)
        assert bench.drive(900, 0.5, seeing=False) == HALF


def test_a_car_that_stands_needs_no_evidence() -> None:
    bench = Bench(settings(evidence_s=1.0)).arm()
    bench.drive(5000, 0.0, seeing=False)
    assert bench.drive(900, 0.5, seeing=False) == HALF


def test_driving_in_bits_without_evidence_adds_up() -> None:
    bench = Bench(settings(evidence_s=1.0)).arm()
    for _ in range(20):
        bench.drive(100, 0.5, seeing=False)
        bench.drive(100, 0.0, seeing=False)
    assert bench.guard.reason is Reason.EVIDENCE


def test_arming_again_begins_to_count_anew() -> None:
    bench = Bench(settings(evidence_s=1.0)).arm()
    bench.drive(1100, 0.5, seeing=False)
    assert bench.guard.reason is Reason.EVIDENCE
    bench.send(flags=Flag.ARM)
    bench.send(flags=Flag.ARM)
    bench.wait(50)
    assert bench.drive(1000, 0.5, seeing=False) == HALF


def test_silences_do_not_hide_missing_evidence() -> None:
    bench = Bench(settings(evidence_s=1.0)).arm()
    for _ in range(20):
        bench.wait(150)
        bench.send(0.5)
    assert bench.guard.reason is Reason.EVIDENCE


def test_a_stop_is_never_too_late() -> None:
    bench = Bench().arm()
    bench.drive(100, 0.5)
    assert bench.send(0.5, flags=Flag.STOP, sequence=0, stamp_ns=0, source=9) == NEUTRAL
    assert (bench.guard.state, bench.guard.reason) == (State.LATCHED, Reason.STOP)
    assert bench.drive(1000, 0.5) == OFF


def test_a_disarm_is_never_too_late_and_does_not_latch() -> None:
    bench = Bench().arm()
    bench.drive(100, 0.5)
    assert bench.send(0.5, flags=Flag.DISARM, sequence=0) == NEUTRAL
    assert bench.guard.state is State.DISARMED
    bench.send(flags=Flag.ARM)
    assert bench.drive(100, 0.5) == HALF


def test_a_stop_or_a_disarm_beside_an_arm_wins() -> None:
    for flag in (Flag.STOP, Flag.DISARM):
        bench = Bench().arm()
        bench.send(flags=flag | Flag.ARM)
        bench.send(flags=flag | Flag.ARM)
        assert bench.guard.state is not State.ARMED


def test_a_latch_needs_an_arm_that_was_not_there_before() -> None:
    bench = Bench().arm()
    bench.send(flags=Flag.ARM)
    bench.guard.fail(Reason.STOP, bench.now_ns)
    for _ in range(100):
        bench.wait(12.5)
        bench.send(flags=Flag.ARM)
    assert bench.guard.state is State.LATCHED
    bench.send()
    bench.send(flags=Flag.ARM)
    assert bench.guard.state is State.DISARMED
    assert bench.guard.reason is Reason.STOP
    bench.send(flags=Flag.ARM)
    assert (bench.guard.state, bench.guard.reason) == (State.ARMED, Reason.NONE)


def test_the_first_reason_of_a_latch_stays() -> None:
    bench = Bench().arm()
    bench.guard.fail(Reason.STOP, bench.now_ns)
    bench.guard.fail(Reason.BUS, bench.now_ns)
    assert bench.guard.reason is Reason.STOP


@pytest.mark.parametrize("reason", [Reason.LOST, Reason.SIGNAL, Reason.KEEPER])
def test_nobody_arms_after_the_source_is_gone(reason: Reason) -> None:
    bench = Bench().arm()
    bench.drive(100, 0.5)
    bench.guard.fail(reason, bench.now_ns)
    assert bench.wait(390) == NEUTRAL
    bench.send()
    bench.send(flags=Flag.ARM)
    assert not bench.guard.is_over
    assert bench.wait(10) == OFF
    assert bench.guard.is_over
    assert bench.guard.state is State.LATCHED


def test_a_board_without_pulses_gets_none_for_the_sake_of_neutral() -> None:
    bench = Bench()
    assert bench.wait(600) == OFF
    bench.guard.fail(Reason.LOST, bench.now_ns)
    assert bench.write() == OFF
    assert bench.guard.is_over


def test_a_board_that_refuses_for_a_moment_does_not_end_a_drive() -> None:
    bench = Bench().arm()
    bench.drive(100, 0.5)
    bench.board_takes = False
    bench.drive(37.5, 0.5)
    bench.board_takes = True
    bench.drive(25, 0.5)
    bench.board_takes = False
    bench.drive(37.5, 0.5)
    assert bench.guard.state is State.ARMED


def test_a_board_that_refuses_for_too_long_does() -> None:
    bench = Bench().arm()
    bench.drive(100, 0.5)
    bench.board_takes = False
    bench.drive(37.5, 0.5)
    assert bench.guard.state is State.ARMED
    bench.drive(12.5, 0.5)
    assert (bench.guard.state, bench.guard.reason) == (State.LATCHED, Reason.BUS)
    bench.guard.fail(Reason.LOST, bench.now_ns)
    bench.wait(1000)
    assert not bench.guard.is_over, "pulses stand until the board takes the end of them"
    bench.board_takes = True
    bench.write()
    assert bench.guard.is_over


def test_a_board_that_lost_its_settings_is_not_armed_before_it_has_them_again() -> None:
    bench = Bench(settings(arming_s=0.05)).arm_after(100)
    bench.guard.fail(Reason.BOARD, bench.now_ns)
    assert bench.guard.needs_setup
    bench.send()
    for _ in range(20):
        bench.wait(12.5)
        bench.send(flags=Flag.ARM)
    assert bench.guard.state is State.DISARMED
    bench.guard.restored()
    bench.send(flags=Flag.ARM)
    assert bench.guard.state is State.DISARMED, "neutral begins to stand again"
    bench.write()
    bench.wait(50)
    bench.send(flags=Flag.ARM)
    assert bench.guard.state is State.ARMED


def test_late_commands_are_counted() -> None:
    bench = Bench().arm()
    bench.drive(100, 0.5)
    bench.wait(25)
    bench.send(0.5)
    assert bench.reply.late == 0
    bench.wait(26)
    bench.send(0.5)
    assert bench.reply.late == 1


def test_counts_that_no_longer_fit_stay_at_the_largest() -> None:
    bench = Bench()
    reply = bench.guard.reply(bench.now_ns, 2**40)
    assert read_reply(pack_reply(reply)) == reply
    assert reply.retries == 2**32 - 1


BRAKE = (1530.0, 1900.0)
"""Full brake: the pulse of throttle -1."""


def test_the_brake_is_used_in_a_silence_after_driving_forward() -> None:
    bench = Bench(settings(brake=-1.0)).arm()
    bench.drive(100, 0.5)
    assert bench.wait(100) == BRAKE
    assert bench.wait(390) == BRAKE
    assert bench.wait(10) == OFF


def test_a_car_that_coasts_is_braked_too() -> None:
    bench = Bench(settings(brake=-1.0)).arm()
    bench.drive(100, 0.5)
    bench.drive(100, 0.0)
    assert bench.wait(100) == BRAKE


def test_the_brake_is_no_stronger_than_reverse_may_be() -> None:
    bench = Bench(settings(brake=-1.0, max_reverse=0.25)).arm()
    bench.drive(100, 0.5)
    assert bench.wait(100) == (1530.0, 1600.0)


@pytest.mark.parametrize(
    "throttles",
    [
        (),
        (0.0,),
        (0.5, -0.5),
        (0.5, -0.5, 0.0),
        (0.5, -0.01, 0.0),
        (0.5, -0.5, 0.0, 0.05),
        (0.1,),
        (-0.5, 0.0),
    ],
    ids=[
        "never drove",
        "stands",
        "brakes",
        "braked",
        "braked little",
        "within the dead zone",
        "at its edge",
        "reverse",
    ],
)
def test_what_would_be_reverse_is_never_sent_as_a_brake(throttles: tuple[float, ...]) -> None:
    bench = Bench(settings(brake=-1.0)).arm()
    for throttle in throttles:
        bench.drive(100, throttle)
    assert bench.wait(100) == NEUTRAL


def test_a_second_silence_after_a_brake_does_not_reverse() -> None:
    bench = Bench(settings(brake=-1.0)).arm()
    bench.drive(100, 0.5)
    assert bench.wait(100) == BRAKE
    assert bench.send(0.0) == NEUTRAL
    assert bench.wait(100) == NEUTRAL


def test_a_stop_brakes_too_if_it_may() -> None:
    bench = Bench(settings(brake=-1.0)).arm()
    bench.drive(100, 0.5)
    assert bench.send(flags=Flag.STOP) == BRAKE
    assert bench.send(flags=Flag.STOP) == BRAKE


def test_a_forward_too_short_to_be_seen_does_not_grow_while_the_car_coasts() -> None:
    bench = Bench(settings(brake=-1.0)).arm()
    bench.drive(12.5, 0.5)
    bench.drive(200, 0.0)
    assert bench.send(flags=Flag.STOP) == NEUTRAL  # two periods of the board are 35 ms


def test_arming_forgets_that_the_car_went_forward() -> None:
    bench = Bench(settings(brake=-1.0)).arm()
    bench.drive(100, 0.5)
    bench.send(flags=Flag.DISARM)
    bench.arm()
    bench.drive(25, 0.0)
    assert bench.send(flags=Flag.STOP) == NEUTRAL  # somebody may have turned the car, and a brake would be reverse


def packet(bench: Bench, throttle: float = 0.0, flags: Flag = Flag.NONE) -> None:
    """Give a command that is read in the same turn as the next one: nothing is written in between."""
    bench.sequence += 1
    bench.guard.take(pack(CommandPacket(bench.sequence, bench.now_ns, 0.0, throttle, 0, flags)), bench.now_ns)


def test_a_forward_that_was_commanded_and_never_sent_allows_no_brake() -> None:
    bench = Bench(settings(brake=-1.0)).arm()
    bench.drive(1000, -0.5)
    packet(bench, 0.5)
    packet(bench, flags=Flag.STOP)
    assert bench.wait(100) == NEUTRAL


def test_a_forward_that_the_board_refused_allows_no_brake() -> None:
    bench = Bench(settings(brake=-1.0)).arm()
    bench.drive(1000, -0.5)
    bench.board_takes = False
    bench.drive(37.5, 0.5)
    bench.board_takes = True
    assert bench.send(flags=Flag.STOP) == NEUTRAL


def test_a_reverse_that_the_board_may_have_taken_allows_no_brake() -> None:
    bench = Bench(settings(brake=-1.0)).arm()
    bench.drive(1000, 0.5)
    bench.board_takes = False
    bench.drive(12.5, -0.5)
    bench.board_takes = True
    assert bench.send(flags=Flag.STOP) == NEUTRAL


@pytest.mark.parametrize(("stood_ms", "allowed"), [(34, False), (35, True)])
def test_a_forward_counts_when_it_stood_for_two_periods_of_pulses(stood_ms: float, allowed: bool) -> None:
    bench = Bench(settings(brake=-1.0)).arm()
    bench.drive(1000, -0.5)
    bench.send(0.5)
    bench.wait(stood_ms)
    assert bench.send(flags=Flag.STOP) == (BRAKE if allowed else NEUTRAL)


def test_a_board_that_lost_its_settings_gets_no_brake() -> None:
    bench = Bench(settings(brake=-1.0)).arm()
    bench.drive(1000, 0.5)
    bench.guard.fail(Reason.BOARD, bench.now_ns)
    assert bench.write() == NEUTRAL


def test_a_fault_of_a_disarmed_car_does_not_brake_again() -> None:
    bench = Bench(settings(brake=-1.0)).arm()
    bench.drive(100, 0.5)
    assert bench.send(flags=Flag.STOP) == BRAKE
    bench.send()
    assert bench.send(flags=Flag.ARM) == NEUTRAL
    bench.guard.fail(Reason.STOP, bench.now_ns)
    assert bench.write() == NEUTRAL


def test_a_forward_below_neutral_pulses_is_told_apart_by_the_calibration() -> None:
    turned = THROTTLE._replace(minus_us=1100.0, plus_us=1900.0)
    bench = Bench(settings(throttle=turned, brake=-1.0)).arm()
    bench.drive(100, 0.5)
    assert bench.wait(100) == (1530.0, 1100.0)


def within(pulses: tuple[float, float]) -> bool:
    return pulses == OFF or (
        STEERING.min_us <= pulses[0] <= STEERING.max_us and THROTTLE.min_us <= pulses[1] <= THROTTLE.max_us
    )


def test_20000_random_packets_do_no_harm() -> None:
    """Half of them are noise, half are commands with random content; no exception, no pulse outside the limits."""
    draw = random.Random(18)
    bench = Bench(settings(brake=-1.0, evidence_s=1.0)).arm()
    extremes = (0.0, 0.5, -0.5, 1.0, -1.0, 1e308, -1e308, 5e-324, math.nan, math.inf, -math.inf)
    states = set()
    for _ in range(20_000):
        bench.now_ns += draw.choice((0, MS, 12 * MS, 60 * MS, 700 * MS))
        if draw.random() < 0.5:
            pulses = bench.give(draw.randbytes(draw.choice((0, 1, 47, 48, 49, 51, 52, 53, 56, 64, 4096))))
        else:
            changes: dict[str, Any] = {}
            if draw.random() < 0.3:
                changes = draw.choice(
                    (
                        {"sequence": draw.getrandbits(64) >> draw.randrange(64)},
                        {"stamp_ns": draw.getrandbits(63) - 2**62},
                        {"evidence": draw.getrandbits(20)},
                        {"source": draw.getrandbits(16)},
                    )
                )
            flags = Flag(draw.choice((0, 0, 0, 0, 0, 1, 1, 2, 3, 4, 7)))
            throttle = 0.0 if flags & Flag.ARM else draw.choice(extremes)
            pulses = bench.send(throttle, draw.choice(extremes), flags, **changes)
            if bench.reply.sequence > 2**60:
                bench = Bench(settings(brake=-1.0, evidence_s=1.0))
        assert within(pulses)
        states.add(bench.guard.state)
    assert states == set(State)


@given(st.binary(max_size=80))
def test_noise_is_refused(packet: bytes) -> None:
    bench = Bench().arm()
    bench.drive(50, 0.5)
    assert bench.give(packet) == HALF
    assert bench.reply.refusal is Refusal.FORM


@given(st.floats(), st.floats(), st.sampled_from([Flag.NONE, Flag.ARM]), st.booleans())
def test_any_numbers_give_pulses_within_the_limits(steering: float, throttle: float, flags: Flag, armed: bool) -> None:
    bench = Bench().arm() if armed else Bench()
    pulses = bench.send(throttle, steering, flags)
    assert within(pulses)
    assert armed or pulses == NEUTRAL
