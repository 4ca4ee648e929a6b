"""Measure this project against what else one could do, on the same data in the same run.

Comparisons
    touches      contacts the planner chose against random contacts the same hand reaches
    choice       the choice of contacts against what is possible, criteria side by side
    grasps       grasps held on the true object, after touching and from the prior alone
    loops        whole sessions to a goal, from raw signals and from readings with noise
    readers      raw signals read, beside a straightforward implementation
    estimators   our estimator against others on the same contacts, accuracy and time as ratios

The estimators compared
    ours         one problem at a time, and many in a batch
    labels       one scipy.optimize.least_squares fit for each of the 2^n labellings
    RANSAC       minimal samples of the normals' line complex, robust refinement (PotSAC's kind)
    complex      the textbook fit of a linear complex to the normals (Pottmann and Randrup)
    pyransac3d   that package's cylinder, on the positions alone

What holds on any machine are the ratios; times in milliseconds are of this one, on one core.

Exit status: 0 measured, 2 bad input.

Examples:
    python scripts/benchmark.py touches --runs 20 --objects can bottle
    python scripts/benchmark.py loops --sensors gel-depth --runs 20 --jobs 4
    python scripts/benchmark.py readers
    python scripts/benchmark.py estimators --runs 20
    python scripts/benchmark.py estimators --contacts 3 10 --sensors gel --out ratios.json
    python scripts/benchmark.py estimators --help
"""

from __future__ import annotations

import os
import sys
from typing import Annotated

for library in ("OMP", "OPENBLAS", "MKL", "NUMBA"):  # one core; read when numpy is first imported
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import benchmark_choice  # noqa: E402
import benchmark_estimators  # noqa: E402
import benchmark_loops  # noqa: E402
import benchmark_readers  # noqa: E402
import benchmark_touches  # noqa: E402
import grasp_study  # noqa: E402
import tyro  # noqa: E402
from tyro.conf import subcommand  # noqa: E402

Touches = Annotated[
    benchmark_touches.Options, subcommand("touches", description=benchmark_touches.__doc__)
]
Choice = Annotated[
    benchmark_choice.Options, subcommand("choice", description=benchmark_choice.__doc__)
]
Grasps = Annotated[grasp_study.Options, subcommand("grasps", description=grasp_study.__doc__)]
Loops = Annotated[benchmark_loops.Options, subcommand("loops", description=benchmark_loops.__doc__)]
Readers = Annotated[
    benchmark_readers.Options, subcommand("readers", description=benchmark_readers.__doc__)
]
Estimators = Annotated[
    benchmark_estimators.Options,
    subcommand("estimators", description=benchmark_estimators.__doc__),
]


def main() -> int:
    commands = Touches | Choice | Grasps | Loops | Readers | Estimators
    options = tyro.cli(commands, description=__doc__)
    match options:
        case benchmark_touches.Options():
            return benchmark_touches.main(options)
        case benchmark_choice.Options():
            return benchmark_choice.main(options)
        case grasp_study.Options():
            return grasp_study.main(options)
        case benchmark_loops.Options():
            return benchmark_loops.main(options)
        case benchmark_readers.Options():
            return benchmark_readers.main(options)
        case _:
            return benchmark_estimators.main(options)


if __name__ == "__main__":
    sys.exit(main())
