"""Ten pushing policies whose skills are far apart: fewer seeds tell how simulators rank them.

    pytest suites/test_transfer.py --sim=all --reps 100 --policies suites/policies/ladder.py

Chosen on MuJoCo, by 60 episodes of the seeds 990000 to 990059 each: from 0 to 0.93, 0.1 apart.
"""

from pytest_simbench.suites.policies import Limp
from pytest_simbench.suites.policies.pushing import SCRIPTED, TRAINED, Push

CAREFUL = {**dict(zip(Push.bounds, TRAINED["mujoco-1"]["numbers"], strict=True)), "free": 0.3}
"""It does not hurry where it travels."""

policies = {
    "careful-sharp": Push("careful-sharp", CAREFUL.values(), offset=0.0),
    "careful": Push("careful", CAREFUL.values()),
    "mujoco-1": Push("mujoco-1", TRAINED["mujoco-1"]["numbers"]),
    "pybullet-1": Push("pybullet-1", TRAINED["pybullet-1"]["numbers"]),
    "sapien-0": Push("sapien-0", TRAINED["sapien-0"]["numbers"]),
    "scripted": Push("scripted", SCRIPTED.values()),
    "ode-0": Push("ode-0", TRAINED["ode-0"]["numbers"]),
    "drake-0": Push("drake-0", TRAINED["drake-0"]["numbers"]),
    "careful-blurred": Push("careful-blurred", CAREFUL.values(), offset=0.013),
    "limp": Limp(Push.task),
}
