"""The guard: it decides which pulses may stand now. No clock, no bus, no socket: all come as arguments.

disarmed --ARM, throttle 0, neutral has stood--> armed --fault--> latched --ARM, throttle 0--> disarmed
    ^                                              |
    +-------------------- DISARM ------------------+
"""

from __future__ import annotations

from tral_env.hardware.actuator.laws import MAX_SLEW_S, clamped, pulse_us, slewed
from tral_env.hardware.actuator.settings import Settings
from tral_env.hardware.actuator.wire import (
    NOTHING_YET,
    NS,
    CommandPacket,
    Flag,
    Reason,
    Refusal,
    Reply,
    State,
    read,
    refusal,
)

Pulses = tuple[float, float]
"""Steering and throttle, us."""
OFF: Pulses = (0.0, 0.0)
"""No pulses leave the board."""

_NEUTRAL = (0.0, 0.0)
_FINAL = (Reason.LOST, Reason.SIGNAL, Reason.KEEPER)
"""After these nobody is left that could arm."""


class Guard:
    """Judges each packet and each moment; `pulses` says what the board must send."""

    def __init__(self, settings: Settings, now_ns: int) -> None:
        """Begin disarmed, in neutral."""
        self._settings, self._limits = settings, settings.limits
        self.state, self.reason, self.ending = State.DISARMED, Reason.NONE, False
        self._last, self._refusal = NOTHING_YET, Refusal.NONE
        self._heard_ns = self._applied_ns = self._failed_ns = now_ns
        self._applied = _NEUTRAL
        self._stopped, self._halt = False, _NEUTRAL
        """Whether the car was stopped, and the steering and throttle of that: `_stop` alone sets them."""
        self._goes_forward = False
        """Whether the motor controller knows for sure that the car goes forward: by pulses that it was sent."""
        self._forward_ns: int | None = None
        """Pulses that drive forward stand since then."""
        self._told_to_drive, self._blind_ns = False, 0
        """Whether the last command drove, and for how long that went on without a change of the observations."""
        self._standing_ns: int | None = None
        """Neutral stands since then."""
        self._refusing_ns: int | None = None
        """The board refuses pulses since then."""
        self._sent: Pulses = self.neutral_us
        self.needs_setup = False
        """Whether the board has to be set up anew before the motor may be let go."""
        self._refused = self._late = self._silences = 0

    def take(self, packet: bytes, now_ns: int) -> None:
        """Judge a packet from the socket."""
        command = read(packet)
        if command is None:
            self._refuse(Refusal.FORM)
            return
        why = refusal(command, self._last, now_ns, self._ns(self._limits.max_age_s))
        if why is Refusal.NONE and self.state is State.ARMED and command.source != self._last.source:
            why = Refusal.SOURCE
        # To stop is never too late, out of order, or somebody else's.
        if command.flags & Flag.STOP:
            self.fail(Reason.STOP, now_ns)
        elif command.flags & Flag.DISARM and self.state is State.ARMED:
            self.state = State.DISARMED
        if why is not Refusal.NONE:
            self._refuse(why)
            return
        self._follow(command, now_ns)

    def fail(self, reason: Reason, now_ns: int) -> None:
        """Latch the disarm: neutral or the brake now, no pulses later. The first reason stays."""
        self.ending = self.ending or reason in _FINAL
        if reason is Reason.BOARD:  # nobody knows which pulses left it
            self.needs_setup, self._goes_forward, self._forward_ns = True, False, None
        if self.state is State.LATCHED:
            return
        # A board that sends no pulses gets none for the sake of neutral.
        self._failed_ns = now_ns if self._sent != OFF else now_ns - self._ns(self._limits.off_s)
        if self.state is State.ARMED:
            self._stop(now_ns)
        else:
            self._halt = _NEUTRAL
        self.state, self.reason = State.LATCHED, reason

    def restored(self) -> None:
        """Note that the board was set up anew; neutral begins to stand again."""
        self.needs_setup, self._standing_ns = False, None

    def pulses(self, now_ns: int) -> Pulses:
        """What the board must send now, steering and throttle, us; `OFF`: nothing."""
        silence_ns, off_ns = self._ns(self._limits.silence_s), self._ns(self._limits.off_s)
        quiet_ns = now_ns - self._heard_ns
        if self.state is State.ARMED and quiet_ns >= silence_ns:
            self._silences += not self._stopped
            self._stop(now_ns)
            if quiet_ns >= off_ns:
                self.fail(Reason.SILENCE, self._heard_ns + silence_ns)
        if self.state is State.LATCHED and now_ns - self._failed_ns >= off_ns - silence_ns:
            return OFF
        if self.state is State.DISARMED and quiet_ns >= off_ns:
            return OFF
        steering, throttle = self._wanted
        return pulse_us(steering, self._settings.steering), pulse_us(throttle, self._settings.throttle)

    def sent(self, pulses: Pulses, took: bool, now_ns: int) -> None:
        """Note whether the board took pulses; a board that refuses them for too long is a fault."""
        if not took:
            self._refusing_ns = now_ns if self._refusing_ns is None else self._refusing_ns
            self._goes_forward, self._forward_ns = False, None  # nobody knows what the board took
            if self.state is State.ARMED and now_ns - self._refusing_ns >= self._ns(self._limits.bus_s):
                self.fail(Reason.BUS, now_ns)
            return
        self._refusing_ns, self._sent = None, pulses
        self._note_direction(pulses, now_ns)
        if pulses != self.neutral_us:
            self._standing_ns = None
        elif self._standing_ns is None:
            self._standing_ns = now_ns

    @property
    def neutral_us(self) -> Pulses:
        """Pulses of steering straight and throttle neutral, us."""
        return self._settings.steering.centre_us, self._settings.throttle.centre_us

    @property
    def is_over(self) -> bool:
        """Whether nobody is left that could arm, and no pulses leave the board."""
        return self.ending and self._sent == OFF

    def reply(self, now_ns: int, retries: int) -> Reply:
        """What the source of the commands is told."""
        counts = self._refused, self._late, self._silences, retries
        return Reply(
            self.state, self.reason, self._refusal, self._last.sequence, now_ns, *self._wanted, *self._sent,
            *(min(count, 2**32 - 1) for count in counts),
        )  # fmt: skip

    def _follow(self, command: CommandPacket, now_ns: int) -> None:
        """Take a command that was not refused."""
        before, self._last, self._refusal = self._last, command, Refusal.NONE
        gap_ns, self._heard_ns = now_ns - self._heard_ns, now_ns
        if command.flags & (Flag.STOP | Flag.DISARM):
            return
        if self.state is State.ARMED:
            self._late += gap_ns > self._ns(MAX_SLEW_S)
            self._weigh(command, before, gap_ns)
            self._apply(command, now_ns)
            if self._limits.evidence_s is not None and self._blind_ns > self._ns(self._limits.evidence_s):
                self.fail(Reason.EVIDENCE, now_ns)
        elif command.flags & Flag.ARM and command.throttle == 0.0 and not self.ending:
            self._arm(before, now_ns)

    def _arm(self, before: CommandPacket, now_ns: int) -> None:
        """Do what an ARM may do: undo a latch if it was not held all along, or arm if neutral has stood."""
        if self.state is State.LATCHED:
            if not before.flags & Flag.ARM:
                self.state = State.DISARMED
            return
        stood = self._standing_ns is not None and now_ns - self._standing_ns >= self._ns(self._limits.arming_s)
        if stood and not self.needs_setup:
            self.state, self.reason = State.ARMED, Reason.NONE
            self._applied, self._applied_ns = _NEUTRAL, now_ns
            self._stopped, self._goes_forward, self._forward_ns = False, False, None
            self._told_to_drive, self._blind_ns = False, 0

    @property
    def _wanted(self) -> tuple[float, float]:
        """Steering and throttle that must stand now, if any pulses do."""
        if self.state is State.DISARMED:
            return _NEUTRAL
        return self._applied if self.state is State.ARMED and not self._stopped else self._halt

    def _weigh(self, command: CommandPacket, before: CommandPacket, gap_ns: int) -> None:
        """Sum up the time of driving since the observations changed."""
        if command.evidence > before.evidence:
            self._blind_ns = 0
        elif self._told_to_drive:
            self._blind_ns += gap_ns

    def _apply(self, command: CommandPacket, now_ns: int) -> None:
        """Bring a command within all limits of range and slew."""
        seconds = min((now_ns - self._applied_ns) / NS, MAX_SLEW_S)
        limits, (steering, throttle) = self._limits, self._applied
        turn = clamped(command.steering, -1.0, 1.0)
        drive = clamped(command.throttle, -limits.max_reverse, limits.max_throttle)
        self._applied = (
            slewed(turn, steering, self._settings.steering.slew_per_s, seconds, zero_at_once=False),
            slewed(drive, throttle, self._settings.throttle.slew_per_s, seconds, zero_at_once=True),
        )
        self._applied_ns, self._stopped, self._told_to_drive = now_ns, False, self._applied[1] != 0.0

    def _note_direction(self, pulses: Pulses, now_ns: int) -> None:
        """Note what pulses that the board took tell the motor controller about the direction."""
        channel = self._settings.throttle
        beyond_us = pulses[1] - channel.centre_us
        if pulses == OFF or beyond_us * (channel.minus_us - channel.centre_us) > 0.0:
            self._goes_forward, self._forward_ns = False, None
        elif abs(beyond_us) > channel.dead_zone_us:
            self._forward_ns = now_ns if self._forward_ns is None else self._forward_ns
        else:  # coasts
            self._goes_forward, self._forward_ns = self._knows_forward(now_ns), None

    def _knows_forward(self, now_ns: int) -> bool:
        """Whether pulses that drive forward stood for two periods, so that the motor controller has seen one whole."""
        seen_ns = 2 * self._ns(self._settings.period_us * 1e-6)
        return self._goes_forward or (self._forward_ns is not None and now_ns - self._forward_ns >= seen_ns)

    def _stop(self, now_ns: int) -> None:
        """Go to neutral, or to the brake where it cannot be taken for reverse; the first call alone decides."""
        if not self._stopped:
            brake = max(self._limits.brake, -self._limits.max_reverse)
            self._halt = (0.0, brake) if self._knows_forward(now_ns) else _NEUTRAL
            self._applied, self._stopped = _NEUTRAL, True

    def _refuse(self, why: Refusal) -> None:
        self._refused += 1
        self._refusal = why

    @staticmethod
    def _ns(seconds: float) -> int:
        return round(seconds * NS)
