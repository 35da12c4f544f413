"""False wins among equal simulators, and the power for a loss of 10 points, by simulation.

    python benchmarks/false_wins.py [RUNS] [SIMULATORS...]

Bound: a false win in at most 5 % of the runs. Each run has n = 20 repetitions of 3, 8 or 10
simulators at three outcomes (share of 15 cubes placed, hits, an error of skewed size), which
`measure.differences` tells apart by its step-down max-T. `equal`: all outcomes are drawn alike.
`one worse`: those of one simulator are truly worse, and a win counts as false between two of the
others. `power`: one simulator places 10 points less, and it is counted how often each other one is
found better at it.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from common import arguments
from numpy.typing import NDArray

from pytest_simbench.measure import differences

Array = NDArray[np.float64]
N, SIGNS = 20, 1999


def outcomes(rng: np.random.Generator, loss: float = 0.0) -> Array:
    """(3, N): placed, hit, error. `loss` is of what is placed; of more than 0.5 nothing is left."""
    placed = rng.binomial(15, np.clip(rng.beta(18, 2, N) - loss, 0, 1)) / 15
    if loss > 0.5:
        return np.array([0 * placed, 0 * placed, np.full(N, 90.0)])
    return np.array([placed, rng.random(N) < 0.85, np.exp(rng.normal(0, 1, N))])


def found(rng: np.random.Generator, sides: int, loss: float) -> tuple[Array, Array]:
    """Whether the pairs with the last side, and the others, are told apart; (pairs, 3) each."""
    values = [outcomes(rng, loss * (side == sides - 1)) for side in range(sides)]
    pairs = list(combinations(range(sides), 2))
    columns = np.concatenate([(values[b] - values[a]).T for a, b in pairs], axis=1)
    length = np.sqrt((columns**2).sum(0))
    columns /= np.where(length > 0, length, 1)
    apart = differences.step_down(columns)[0].reshape(-1, 3) <= 0.05
    last = np.array([b == sides - 1 for _, b in pairs])
    return apart[last], apart[~last]


def main() -> None:
    given = arguments(__doc__, {"runs": 1000, "simulators": []})
    differences.PERMUTATIONS = SIGNS
    print(f"{given.runs} runs each, n = {N}")
    print("| simulators | equal | one worse | power |\n| --: | --: | --: | --: |")
    for sides in map(int, given.simulators or (3, 8, 10)):
        rates = []
        for loss in (0.0, 1.0, 0.1):
            rng = np.random.default_rng(1)
            made = [found(rng, sides, loss) for _ in range(given.runs)]
            if loss == 0.1:
                rates.append(np.mean([last[:, 0].mean() for last, _ in made]))
            else:
                false = [others.any() or (not loss and last.any()) for last, others in made]
                rates.append(np.mean(false))
        cells = " | ".join(f"{100 * rate:.1f} %" for rate in rates)
        print(f"| {sides} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
