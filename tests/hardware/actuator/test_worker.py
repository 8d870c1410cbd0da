"""The worker's turns: packets in, pulses out, retries, the board read back, its keeper heard. Nothing here sleeps."""

from collections.abc import Iterator
from threading import Thread
from typing import Any

import pytest
from rig import NEUTRAL, OFF, Works, settings

from tral_env.hardware.actuator import guard
from tral_env.hardware.actuator.wire import ENDED, MAX_PACKET, Flag, Reason, State

HALF = (1530.0, 1300.0)


@pytest.fixture
def works() -> Iterator[Any]:
    opened = []

    def make(**limits: Any) -> Works:
        opened.append(Works(settings(**limits)))
        return opened[-1]

    yield make
    for each in opened:
        each.close()


def test_a_command_becomes_pulses_and_is_answered(works: Any) -> None:
    car = works().arm()
    car.drive(100, 0.5)
    assert car.board.stands == HALF
    reply = car.told()[-1]
    assert (reply.state, reply.steering_us, reply.throttle_us, reply.sequence) == (State.ARMED, *HALF, car.sequence)


def test_a_change_of_state_is_told_once_without_being_asked(works: Any) -> None:
    car = works().arm()
    car.drive(100, 0.5)
    car.told()
    car.turns(1000)
    assert [(reply.state, reply.reason) for reply in car.told()] == [(State.LATCHED, Reason.SILENCE)]


def test_pulses_that_do_not_change_are_sent_again_every_100_ms(works: Any) -> None:
    car = works()
    before = len([1 for _, method, _ in car.board.done if method == "pulses"])
    car.turns(400)
    assert len([1 for _, method, _ in car.board.done if method == "pulses"]) - before == 4


def test_the_newest_of_many_packets_counts_and_a_flood_does_not_keep_the_worker(works: Any) -> None:
    car = works().arm()
    for i in range(100):
        car.send(i / 100)
    before = car.board.tries
    car.turn()
    assert car.board.stands == pytest.approx((1530, 1500 - 4 * 63))
    assert car.board.tries - before <= 2
    car.turn()
    assert car.board.stands == pytest.approx((1530, 1500 - 4 * 99))


def test_a_source_that_ends_is_neutral_at_once_and_no_pulses_later(works: Any) -> None:
    car = works().arm()
    car.drive(100, 0.5)
    car.source.close()
    assert car.turn() == [car.ends[0]]
    assert car.board.stands == NEUTRAL
    for _ in range(40):
        car.clock.sleep(0.01)
        car.worker.turn(False, False)
    assert car.board.stands == OFF
    assert car.worker.guard.is_over


def test_the_pulses_end_by_the_boards_own_off_and_never_as_pulses_of_no_length(works: Any) -> None:
    """A driver brings pulses within their limits, so a pulse of 0 would be full throttle."""
    car = works().arm()
    car.drive(100, 0.5)
    car.turns(600)
    assert car.board.done[-1][1:] == ("off", OFF)
    assert not [pulses for _, method, pulses in car.board.done if method == "pulses" and pulses == OFF]


def test_one_error_in_ten_thousand_transactions_does_not_end_a_drive(works: Any) -> None:
    car = works().arm()
    for _ in range(50):
        car.drive(100, 0.5)
        car.board.failures = 1
        car.send(0.25)
        car.turn()
        assert car.board.stands == (1530.0, 1400.0)
    assert car.worker.guard.state is State.ARMED
    assert car.worker.retries == 50


def test_a_transaction_is_tried_three_times_a_turn(works: Any) -> None:
    car = works().arm()
    car.board.failures, before = 10**6, car.board.tries
    car.send(0.5)
    car.turn()
    assert car.board.tries - before == 3


@pytest.mark.parametrize(("takes_ms", "tries"), [(2.0, 3), (3.0, 2), (6.0, 1)])
def test_retries_stay_within_the_budget_of_a_tick(works: Any, takes_ms: float, tries: int) -> None:
    car = works().arm()
    car.board.failures, car.board.takes_ms, before = 10**6, takes_ms, car.board.tries
    car.send(0.5)
    car.turn()
    assert car.board.tries - before == tries


def test_a_board_that_refuses_for_long_ends_the_drive_and_neutral_is_tried_until_it_is_taken(works: Any) -> None:
    car = works().arm()
    car.drive(100, 0.5)
    car.board.failures = 10**6
    car.drive(80, 0.5)
    assert car.worker.guard.reason is Reason.BUS
    assert car.told()[-1].reason is Reason.BUS
    car.board.failures = 0
    car.turn()
    assert car.board.stands == NEUTRAL


def test_a_brown_out_is_noticed_and_mended_only_when_somebody_arms(works: Any) -> None:
    car = works(arming_s=0.05)
    car.turns(60)
    car.arm()
    car.drive(100, 0.5)
    car.board.lost = "MODE1 0x11"
    car.drive(210, 0.5)
    assert car.worker.guard.reason is Reason.BOARD
    starts = [pulses for _, method, pulses in car.board.done if method == "start"]
    assert len(starts) == 1
    car.send()
    car.turn()
    car.send(flags=Flag.ARM)
    car.turn()
    assert [method for _, method, _ in car.board.done].count("start") == 2
    assert car.worker.guard.state is State.DISARMED
    for _ in range(10):
        car.send(flags=Flag.ARM)
        car.turn()
    assert car.worker.guard.state is State.ARMED


def test_a_board_that_cannot_be_set_up_is_not_armed(works: Any) -> None:
    car = works().arm()
    car.worker.guard.fail(Reason.BOARD, car.clock.now_ns)
    car.send()
    car.turn()
    car.board.failures = 10**6
    for _ in range(10):
        car.send(flags=Flag.ARM)
        car.turn()
    assert car.worker.guard.state is State.DISARMED


def test_a_read_back_that_fails_is_no_brown_out(works: Any) -> None:
    car = works().arm()
    car.board.cannot_be_read = True
    car.drive(800, 0.5)
    assert car.worker.guard.state is State.ARMED
    assert car.worker.retries == 12


def test_settings_that_can_never_be_read_back_are_a_fault(works: Any) -> None:
    car = works().arm()
    car.board.cannot_be_read = True
    car.drive(1010, 0.5)
    assert car.worker.guard.reason is Reason.BUS
    assert car.board.stands == NEUTRAL


def test_a_driver_that_fails_in_its_own_way_is_a_board_that_refuses(works: Any) -> None:
    car = works().arm()
    car.drive(100, 0.5)
    car.board.failures, car.board.error = 10**6, ValueError("a short answer")
    car.drive(80, 0.5)
    assert car.worker.guard.reason is Reason.BUS
    car.board.failures = 0
    car.turn()
    assert car.board.stands == NEUTRAL


def test_a_keeper_that_is_gone_ends_the_drive(works: Any) -> None:
    car = works().arm()
    car.drive(100, 0.5)
    car.keeper.close()
    assert car.turn() == [car.ends[1]]
    assert car.board.stands == NEUTRAL
    assert car.told()[-1].reason is Reason.KEEPER


def test_a_keeper_that_stands_still_ends_the_drive(works: Any) -> None:
    car = works().arm()
    car.keeper_lives = False
    car.drive(150, 0.5)
    assert car.worker.guard.state is State.ARMED
    car.drive(20, 0.5)
    assert car.worker.guard.reason is Reason.KEEPER
    assert car.board.stands == NEUTRAL


def test_the_keeper_sees_a_sign_of_life_every_tick_and_no_more(works: Any) -> None:
    car = works()
    for _ in range(100):
        car.turn(2)
    seen = 0
    while True:
        try:
            car.keeper.recv(16)
        except BlockingIOError:
            break
        seen += 1
    assert seen == 20


def test_a_signal_ends_the_drive(works: Any) -> None:
    car = works().arm()
    car.drive(100, 0.5)
    car.worker.end()
    car.turn()
    assert car.board.stands == NEUTRAL
    assert car.told()[-1].reason is Reason.SIGNAL
    car.turns(400)
    assert car.worker.guard.is_over


@pytest.mark.parametrize("throttle", [0.5, 0.0], ids=["a command", "an arming"])
def test_a_signal_amid_a_decision_is_not_undone_by_it(
    works: Any, monkeypatch: pytest.MonkeyPatch, throttle: float
) -> None:
    car = works()
    if throttle:
        car.arm().drive(100, throttle)
    else:
        car.turn()
    interrupted = "slewed" if throttle else "read"
    real = getattr(guard, interrupted)

    def signalled(*arguments: Any, **named: Any) -> Any:
        monkeypatch.setattr(guard, interrupted, real)
        car.worker.end()
        return real(*arguments, **named)

    monkeypatch.setattr(guard, interrupted, signalled)
    car.send(throttle, Flag.NONE if throttle else Flag.ARM)
    car.turn()
    car.turn()
    assert (car.worker.guard.state, car.worker.guard.reason) == (State.LATCHED, Reason.SIGNAL)
    assert car.board.stands == NEUTRAL
    car.turns(400)
    assert car.worker.guard.is_over


def test_a_source_that_does_not_read_does_not_stop_the_worker(works: Any) -> None:
    car = works().arm()
    for _ in range(2000):
        car.send(0.5)
        car.turn()
    assert car.board.stands == HALF


def test_the_last_word_reaches_a_source_that_begins_to_read_late(works: Any) -> None:
    car = works().arm()
    for _ in range(2000):
        car.send(0.5)
        car.turn()
    last_word = Thread(target=car.worker.say_ended)
    last_word.start()
    car.source.setblocking(True)
    while (packet := car.source.recv(MAX_PACKET)) != ENDED:
        assert packet
    last_word.join()
