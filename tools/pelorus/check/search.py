# SPDX-License-Identifier: MIT
"""Searches the settings of greatest likelihood, in the logarithms of the sigmas.

In each round every parameter is tried a step up and a step down, all at once on all processors.
Three points give a parabola, and all parameters move to their vertices together; the best of
everything tried is kept. Then the step shrinks. A round that gains nothing does not end the search:
on real drives the next, smaller step still gained 0.1 to 0.2 of -2 ln likelihood an observation.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from pelorus.check.options import Settings
from pelorus.check.outcome import Bench, Outcome
from pelorus.check.parameters import Parameter, limits, written

COARSE, COARSE_FRAMES = (2.0, 2.0, 2.0), "300"  # of a coarse search
FARTHEST = 2.0  # steps: farthest move to a vertex
WORTH_ANOTHER = 0.01  # cost per observation: such a gain asks for another round
LEAST_COST = 2e-5  # cost per observation: a smaller change is no improvement

Build = Callable[[Mapping[str, float]], Settings]


@dataclass(frozen=True)
class BestFound:
    """The best settings that were tried."""

    values: dict[str, float]
    outcome: Outcome


def search_noises(
    bench: Bench,
    side: Settings,
    start: Mapping[str, float],
    parameters: Mapping[str, Parameter],
    steps: Sequence[float],
    what: str = "noise",
) -> BestFound:
    """Searches the given noises within their limits; the settings in `side` stay."""
    build = lambda v: {**side, **written(v, parameters)}  # noqa: E731 - named where it is used
    return search(bench, start, limits(start, parameters), build, steps, what)


def search(
    bench: Bench,
    start: Mapping[str, float],
    within: Mapping[str, tuple[float, float]],
    build: Build,
    steps: Sequence[float],
    what: str = "noise",
) -> BestFound:
    """Searches from `start` in rounds; `build` makes settings of values within their limits."""
    best = BestFound(dict(start), bench.run(build(start)))
    for round_, step in enumerate(steps):
        said = f"{what}, round {round_ + 1} of {len(steps)}"
        better = _round(bench, best, within, build, step, said)
        while better.outcome.cost < best.outcome.cost - WORTH_ANOTHER:
            best, better = better, _round(bench, better, within, build, step, said)
        best = better
    return best


def _round(
    bench: Bench,
    best: BestFound,
    within: Mapping[str, tuple[float, float]],
    build: Build,
    step: float,
    what: str,
) -> BestFound:
    tried: list[dict[str, float]] = []
    for name in best.values:
        for factor in (step, 1 / step):
            tried.append(best.values | {name: _clipped(within[name], best.values[name] * factor)})
    outcomes = bench.run_all([build(values) for values in tried], what)
    moved = dict(best.values)
    for k, name in enumerate(best.values):
        up, down = outcomes[2 * k].cost, outcomes[2 * k + 1].cost
        steps = foot(down, best.outcome.cost, up)
        moved[name] = _clipped(within[name], best.values[name] * step**steps)
    together = BestFound(moved, bench.run(build(moved)))
    singly = (BestFound(v, o) for v, o in zip(tried, outcomes, strict=True))
    return min((best, together, *singly), key=lambda found: found.outcome.cost)


def foot(down: float, middle: float, up: float) -> float:
    """Returns the vertex of the parabola through (-1, down), (0, middle), (1, up), limited."""
    if not all(map(math.isfinite, (down, middle, up))):
        return 0.0
    bend = down - 2 * middle + up
    if bend <= LEAST_COST:  # no minimum: a step downhill, if there is a slope
        return 0.0 if abs(up - down) <= LEAST_COST else math.copysign(1.0, down - up)
    return max(-FARTHEST, min(FARTHEST, 0.5 * (down - up) / bend))


def _clipped(within: tuple[float, float], value: float) -> float:
    return min(max(value, within[0]), within[1])
