"""Laws: cases whose right answer is known, by which a simulator can be wrong all by itself."""

from pytest_simbench.laws.base import Law, Reading
from pytest_simbench.laws.bounce import (
    BounceHeight,
    BounceRatio,
    ElasticChain,
    ObliqueBounce,
    ObliqueBounceStick,
)
from pytest_simbench.laws.contact import (
    CollisionMomentum,
    DeadCollision,
    DeadLanding,
    HeavyOnTop,
    LandingTime,
    Overhang,
    Pivot,
    RestDepth,
    TippingEdge,
    TippingSlope,
    Tower,
)
from pytest_simbench.laws.domino import DominoWave
from pytest_simbench.laws.driven import BallOnBelt, BeltSpeed
from pytest_simbench.laws.drives import (
    EffortLimit,
    FeedForward,
    Sag,
    SpringAndDamper,
    StepResponse,
    Tracking,
)
from pytest_simbench.laws.forces import RestForce, TowerForce
from pytest_simbench.laws.free import DampedFall, FallSpeed, FreeFall, ObliqueGravity, Projectile
from pytest_simbench.laws.hands import (
    GripHolds,
    GripSlips,
    GripSlipsDiagonally,
    PushForce,
    PushStraight,
    PushTips,
)
from pytest_simbench.laws.joints import (
    CompoundPendulum,
    DoublePendulum,
    DoublePendulumEnergy,
    PendulumEnergy,
    PendulumEnergyDrift,
    PendulumPeriod,
    SphericalPendulum,
    SwingingSlider,
    TwoPendulums,
)
from pytest_simbench.laws.loads import PendulumForce, PendulumTorque
from pytest_simbench.laws.loops import FourBarClosure, FourBarSwing
from pytest_simbench.laws.meshes import MeshTwin, RimlessWheel
from pytest_simbench.laws.rolling import (
    FreeCylinder,
    RollingCylinder,
    RollingSphere,
    SlipToRoll,
    SpinToRoll,
)
from pytest_simbench.laws.sliding import (
    Belt,
    Glide,
    SlideDiagonal,
    SlideStraight,
    SlideX,
    SlideY,
    StoppingDistance,
    StoppingDistanceDiagonal,
)
from pytest_simbench.laws.spinning import (
    FreeTop,
    Spin,
    TumbleEnergy,
    TumbleEnergyDrift,
    TumbleMomentum,
    TumbleMomentumDrift,
)
from pytest_simbench.laws.sticking import (
    Carried,
    Creep,
    StickAngle,
    StickAngleAcross,
    StickAngleDiagonal,
)
from pytest_simbench.laws.turning import PushTurns
from pytest_simbench.laws.wrenches import AxialForce, AxialTorque

LAWS: tuple[Law, ...] = (
    FreeFall(), FallSpeed(), DampedFall(), ObliqueGravity(), Projectile(), Spin(), FreeTop(),
    FreeCylinder(), TumbleEnergy(), TumbleMomentum(),
    TumbleEnergyDrift(), TumbleMomentumDrift(), AxialForce(), AxialTorque(),
    LandingTime(), DeadLanding(), DeadCollision(), CollisionMomentum(),
    BounceHeight(), BounceRatio(), ElasticChain(), ObliqueBounce(), ObliqueBounceStick(),
    StickAngle(), StickAngleAcross(), StickAngleDiagonal(), Creep(), Carried(),
    SlideX(), SlideY(), SlideDiagonal(), SlideStraight(), StoppingDistance(),
    StoppingDistanceDiagonal(), Glide(), Belt(), BeltSpeed(), MeshTwin(),
    Pivot(), RollingSphere(), RollingCylinder(), SlipToRoll(), SpinToRoll(), BallOnBelt(),
    RimlessWheel(),
    RestDepth(), RestForce(), Tower(), TowerForce(), HeavyOnTop(), Overhang(), TippingEdge(),
    TippingSlope(),
    GripHolds(), GripSlips(), GripSlipsDiagonally(),
    PendulumPeriod(), CompoundPendulum(), TwoPendulums(), PendulumEnergy(),
    PendulumEnergyDrift(), DoublePendulum(),
    DoublePendulumEnergy(), SwingingSlider(), SphericalPendulum(), StepResponse(),
    SpringAndDamper(), EffortLimit(), Tracking(), Sag(), FeedForward(),
    FourBarClosure(), FourBarSwing(), DominoWave(), PendulumForce(), PendulumTorque(),
    PushForce(), PushStraight(), PushTurns(), PushTips(),
)  # fmt: skip
"""All of them, by phenomenon."""

__all__ = ["LAWS", "Law", "Reading"]
