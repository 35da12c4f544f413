"""False wins among equal simulators, and the power for a loss of 10 points, by simulation.

    python benchmarks/false_wins.py [RUNS [SIMULATORS...]]

Each run has n = 20 repetitions of 3, 8 or 10 simulators at three outcomes (share of 15 cubes
placed, hits, an error of skewed size), and two costs that differ wildly. `equal`: all outcomes are
drawn alike. `one worse`: those of one simulator are truly worse, and a win counts as false between
two of the others. `power`: one simulator places 10 points less, and it is counted how often each
other one is found better at it. Beside what `measure.differences` does (step-down max-T, costs
apart) stands what was before: Benjamini and Hochberg's false-discovery rate over all together.
"""

from __future__ import annotations

import sys
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import false_discovery_control

from pytest_simbench.measure import differences
from pytest_simbench.measure.differences import step_down

Array = NDArray[np.float64]
N, SIGNS = 20, 1999


def outcomes(rng: np.random.Generator, loss: float = 0.0) -> Array:
    """(3, N): placed, hit, error. `loss` is of what is placed; of more than 0.5 nothing is left."""
    placed = rng.binomial(15, np.clip(rng.beta(18, 2, N) - loss, 0, 1)) / 15
    if loss > 0.5:
        return np.array([0 * placed, 0 * placed, np.full(N, 90.0)])
    return np.array([placed, rng.random(N) < 0.85, np.exp(rng.normal(0, 1, N))])


def found(rng: np.random.Generator, sides: int, loss: float) -> dict[str, tuple[Array, Array]]:
    """By method, for the pairs with the last side and for the others, whether they are told apart;
    (pairs, 3)."""
    values = [outcomes(rng, loss * (side == sides - 1)) for side in range(sides)]
    costs = [(side + 1) * rng.normal(1, 0.02, (2, N)) for side in range(sides)]
    pairs = list(combinations(range(sides), 2))
    whole = [np.concatenate([values[b] - values[a], costs[b] - costs[a]]).T for a, b in pairs]
    columns = np.concatenate(whole, axis=1)
    length = np.sqrt((columns**2).sum(0))
    columns /= np.where(length > 0, length, 1)
    outcome = np.tile([True] * 3 + [False] * 2, len(pairs))
    new = step_down(columns[:, outcome])[0]
    signs = rng.choice([-1.0, 1.0], (SIGNS, N))
    drawn, observed = np.abs(signs @ columns), np.abs(columns.sum(0))
    single = (1 + (drawn >= observed - 1e-9).sum(0)) / (1 + SIGNS)
    old = false_discovery_control(single)[outcome]
    last = np.array([b == sides - 1 for _, b in pairs])
    told = {"now": new, "before": old}
    apart = {name: p.reshape(-1, 3) <= 0.05 for name, p in told.items()}
    return {name: (yes[last], yes[~last]) for name, yes in apart.items()}


def main(runs: int = 1000, *simulators: int) -> None:
    differences.PERMUTATIONS = SIGNS
    print(f"{runs} runs each, n = {N}: now / before")
    print("| simulators | equal | one worse | power |\n| --: | --: | --: | --: |")
    for sides in simulators or (3, 8, 10):
        rates: dict[str, list[float]] = {"now": [], "before": []}
        for loss in (0.0, 1.0, 0.1):
            rng = np.random.default_rng(1)
            made = [found(rng, sides, loss) for _ in range(runs)]
            for name, rate in rates.items():
                if loss == 0.1:
                    rate.append(float(np.mean([run[name][0][:, 0].mean() for run in made])))
                else:
                    false = [
                        run[name][1].any() or (not loss and run[name][0].any()) for run in made
                    ]
                    rate.append(float(np.mean(false)))
        cells = [f"{100 * a:.1f} / {100 * b:.1f} %" for a, b in zip(*rates.values(), strict=True)]
        print(f"| {sides} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
