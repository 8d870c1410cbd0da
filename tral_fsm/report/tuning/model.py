"""Pictures of the linear model beside the simulation: step responses, and margins over speed and delay."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

from tral_fsm.report.tuning.plots import NEW, OLD, figure
from tral_fsm.tuning.classical.design import Gains, LinearCar, lqr, margins, step_response
from tral_fsm.tuning.classical.loops import Response

_SPEEDS = np.linspace(0.3, 2.0, 35)
_DELAYS = np.linspace(0.0, 0.3, 31)
_COLOURS = (OLD, NEW, "#2ca02c", "#ff7f0e")


def steps(responses: Mapping[str, tuple[Gains, float, Response]]) -> Figure:
    """Figure of the clearance after a step: simulated (line: mean, band: all cars), and by the linear model (dashes).

    Args:
        responses: name -> gains, speed [m/s], response.
    """
    whole, ax = figure(7.0, 4.0)
    for colour, (name, (gains, speed, response)) in zip(_COLOURS, responses.items(), strict=False):
        label = f"{name}: p = {gains.p:.3g}, d = {gains.d:.3g} at {speed:.3g} m/s"
        seen = np.isfinite(response.clearance).any(axis=0)
        if not seen.any():  # it was too slow for the time limit, or hit a wall before
            ax.plot([], [], color=colour, label=f"{label}; no car came to the step")
            continue
        time, clearance = response.time[seen], response.clearance[:, seen]
        ax.fill_between(time, np.nanmin(clearance, axis=0), np.nanmax(clearance, axis=0), color=colour, alpha=0.15)
        ax.plot(time, np.nanmean(clearance, axis=0), color=colour, label=label)
        ax.plot(*step_response(gains, speed, float(time[-1])), "--", color=colour, linewidth=1.0)
    ax.plot([], [], "--", color="black", linewidth=1.0, label="linear model")
    ax.axhline(1.0, color="black", linewidth=0.6)
    ax.set_xlabel("time after the step [s]")
    ax.set_ylabel("clearance, share of the step")
    ax.legend(fontsize=8)
    return whole


def stability(gains: Mapping[str, tuple[Gains, float]], car: LinearCar | None = None) -> Figure:
    """Figure of phase margin and damping over speed, and over additional delay at the machine's own speed.

    Args:
        gains: name -> gains, speed [m/s]; the LQR gains of each speed are drawn beside them.
        car: car of the model.
    """
    car = car or LinearCar()
    whole = Figure(figsize=(8.4, 5.6), layout="constrained")
    axes = whole.subplots(2, 2, sharey="row", sharex="col")
    for colour, (name, (each, speed)) in zip(_COLOURS, gains.items(), strict=False):
        over_speed = [margins(each, v, car) for v in _SPEEDS]
        over_delay = [margins(each, speed, replace(car, latency_s=car.latency_s + more)) for more in _DELAYS]
        for column, (x, found) in enumerate(((_SPEEDS, over_speed), (1000.0 * _DELAYS, over_delay))):
            axes[0, column].plot(x, [min(one.phase_deg, 120.0) for one in found], color=colour, label=name)
            axes[1, column].plot(x, [one.damping for one in found], color=colour, label=name)
        for row in range(2):
            axes[row, 0].axvline(speed, color=colour, linewidth=0.6, linestyle=":")
    scheduled = [margins(lqr(v, car=car), v, car) for v in _SPEEDS]
    axes[0, 0].plot(
        _SPEEDS, [min(one.phase_deg, 120.0) for one in scheduled], "--", color="black", label="LQR at each speed"
    )
    axes[1, 0].plot(_SPEEDS, [one.damping for one in scheduled], "--", color="black", label="LQR at each speed")
    for ax in axes.flat:
        ax.grid(True, alpha=0.25)
        ax.spines[["top", "right"]].set_visible(False)
        ax.axhspan(-1000.0, 0.0, color="#d62728", alpha=0.12)
    axes[0, 0].set_ylim(-30.0, 122.0)
    axes[1, 0].set_ylim(-0.3, 1.05)
    axes[0, 0].set_ylabel("phase margin [deg]")
    axes[1, 0].set_ylabel("damping ratio")
    axes[1, 0].set_xlabel("speed [m/s]")
    axes[1, 1].set_xlabel("more delay, at the machine's speed [ms]")
    axes[0, 0].legend(fontsize=8)
    return whole
