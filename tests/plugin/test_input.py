"""Bad input is one clear sentence with the valid choices, exit code 4, and no traceback of ours."""

from __future__ import annotations

import importlib.util
import json
import shlex
from fnmatch import fnmatchcase
from pathlib import Path

import pytest

import pytest_simbench.motion.registry
import pytest_simbench.recordings.film
import pytest_simbench.tasks  # noqa: F401 - pytester would import native modules a second time
from pytest_simbench.plugin.session import session_of
from pytest_simbench.records.description import TaskDescription
from pytest_simbench.records.metrics import Metric
from tests.approval import assert_approved_line
from tests.motion.small_arm import TOML, small_arm
from tests.plugin.conftest import Configure
from tests.plugin.inner import CLAIMING, run_pytest, usage_error, wrapper
from tests.plugin.whole import prepare, run

LIMIT = "--sim-baseline=good --sim-compare-fail"

BAD = {
    "--sim=mujocco": "unknown simulator 'mujocco'; choose from *mujoco, *pybullet*all",
    "--reps=0": "--reps=0: give a whole number from 1 to 100000, auto or auto:LIMIT",
    "--reps=many": "--reps=many: give a whole number from 1 to 100000, auto or auto:LIMIT",
    "--reps=auto:x": "--reps=auto:x: give a whole number from 1 to 100000, auto or auto:LIMIT",
    "--reps=auto:0": "--reps=auto:0: give a whole number from 1",
    "--jitter=-1": "--jitter=-1: give a number from 0 to 1000",
    "--protocol=quick": "--protocol=quick: choose from fast, paper, smoke",
    "--sim-crashes=1.5": "--sim-crashes=1.5: give a number from 0 to 1",
    "--sim-crashes=-0.1": "--sim-crashes=-0.1: give a number from 0 to 1",
    "--sim-trace=maybe": "--sim-trace=maybe: choose from first, first-and-failed, *, off",
    "--sim-set=mujoco.timestep": "--sim-set=mujoco.timestep: write it as SIM.SETTING=VALUE",
    "--sim-set=timestep=1": "--sim-set=timestep=1: write it as SIM.SETTING=VALUE",
    "--sim-set=mujoco.speed=1": "mujoco has no setting 'speed'; choose from timestep=*",
    "--sim-set=mujoco.timestep=x": "mujoco.timestep=x: give a finite number",
    "--sim-set=mujoco.timestep=0": "mujoco.timestep=0: give a number of seconds from 1e-06 to 0.01",
    "--sim-set=mujoco.timestep=1e9": "mujoco.timestep=1e+09: *in which a thrown cube moves*",
    "--sim-set=mujoco.cone=round": "mujoco.cone=round: choose from pyramidal, elliptic",
    "--sim-profile=best": "no simulator has a settings profile 'best'; choose from default, tuned",
    "--sim-threshold=placed=x": "--sim-threshold=placed=x: the value must be a finite number",
    "--sim-threshold=crashed=90": "--sim-threshold=crashed=90: crashed is a share, so its "
    "threshold lies between 0 and 1, not at 90; did you mean 0.9?",
    "--sim-threshold=rtf=0": "--sim-threshold=rtf=0: rtf is always at least 0, so that this "
    "threshold can never fail",
    # Releases and builds.
    "'--sim=mujoco==abc d'": "'abc d' is no version; write mujoco==3.3.7",
    "--sim=nosuch==1.0": "unknown simulator 'nosuch==1.0'; choose from ",
    "--sim=mujoco==3.3.7": "not there yet: simbench install mujoco==3.3.7",
    "--sim=mujoco@": "give a path",
    "--sim=mujoco@./nowhere": "there is no such file",
    "'--sim=mujoco@a b=python'": "a label has letters",
    "--sim=mujoco==3.3.7@python": "a build has no release; write mujoco@PYTHON",
    "--sim=mujoco@/bin/sh": "/bin/sh does not run, or is no Python",
    "--sim=mujoco@a=a/python,mujoco@a=b/python": "another build is called mujoco@a too",
    "--sim=nosuch@a=a/python": "unknown simulator 'nosuch'",
    "--sim-python=mujoco": "--sim-python=mujoco: write it as SIM=PATH",
    "--sim-python=nosuch=sh": "unknown simulator 'nosuch'; choose from ",
    "--sim-python=mujoco=/x//y,z": "--sim-python=mujoco=/x//y,z: there is no such file",
    "--sim-python=mujoco=sh --sim-python=mujoco=sh": "mujoco is given twice; give it",
    "--sim-spec=mujoco=x": "--sim-spec=mujoco=x: 'x' is none of execnet's keys",
    "--sim-spec=mujoco=popen --sim-python=mujoco=sh": "mujoco has both --sim-python and",
    # Robots.
    "--robot=ur7": "--robot=ur7: unknown robot 'ur7'; choose from panda, so101, ur10, ur5, xarm7",
    "--robot=": "robot='': give a name (simbench robots), a robot file, or all",
    "--robot=none.toml": "--robot=none.toml: cannot read the robot file none.toml: No such file",
    "--robot=bad.toml": "--robot=bad.toml: bad.toml, [[]arm[]]: stiffness: -1 is no number of at",
    # Baselines and limits.
    "--sim-compare-fail=x:5%": "--sim-compare-fail needs a run to compare with: ",
    f"{LIMIT}=rtf:200%": "rtf:200% can never be exceeded: rtf cannot fall by ",
    f"{LIMIT}=placed:5": "placed:5 can never be exceeded: placed lies between 0 and 100 %; "
    "*placed:5%?",
    f"{LIMIT}=landed": "--sim-compare-fail=landed: write it as placed:5%,",
    f"{LIMIT}=landed:-5%": "landed:-5%: write it as placed:5%,",
    f"{LIMIT}=": "--sim-compare-fail='': write it as placed:5%,",
    f"{LIMIT}=ram:5%,ram:6%": "ram has two limits; give it one",
    f"{LIMIT}=lended:5%": "no metric is named 'lended' in the baseline; did you mean 'landed'? "
    "valid names: *landed, *ram,",
    f"{LIMIT}=landing_x:5%": "landing_x can be neither better nor worse",
    "--sim-baseline=nowhere": "there is no baseline *nowhere; give a run folder, its ",
    "--sim-baseline=text": "the baseline cannot be read: *text:1: not JSON",
    "--sim-baseline=empty": "the baseline *empty holds no repetition; give a run folder",
    "--sim-baseline=other.json": "the baseline *other.json holds no repetition of a sim",
    "--sim-baseline=wrong.json": "the baseline *'benchmarks' is not a list",
    # Folders.
    "--sim-output=text": "text is a file",
    "--sim-output=text/x": "text is a file",
    "--sim-output=link": "link is a link to nothing",
    "--sim-output=/proc/x": "",
    f"--sim-output={'x' * 300}": "longer than any file",
    "--sim-resume": "there is no run to resume in *.simbench; name the folder of a run",
    "--sim-resume=none": "there is no run to resume in *none (it has no records.jsonl); ",
    "--sim-resume=a --sim-output=b": "--sim-resume a and --sim-output b: ",
    "--sim-resume=bad": "--sim-resume: *bad/records.jsonl:1: not JSON",
    "--sim-data=hree": "--sim-data: hree is no folder; name the one that holds",
    "--sim-record=mcap --sim-trace=off": "leave --sim-trace=off out",
    "--sim-cluster=tcp://127.0.0.1:1 --sim-video=on": "--sim-video is for simulators on this",
    "--sim-cluster=tcp://127.0.0.1:1 --sim-pictures": "--sim-pictures is for simulators on this",
    "--sim-cluster=tcp://127.0.0.1:1 --sim-jobs=2": "leave out --sim-jobs; each node says itself",
    # Scenes.
    "--sim-scene=none.xml": "none.xml*No such file",
    "--sim-scene=scene.sdf": "scene.sdf*not read yet",
    "--sim-scene=scene.txt": "scene.txt*no engine here reads .txt files",
    "--sim-scene=open.xml": "open.xml*line 1",
    "--sim-scene=entity.xml": "entity.xml*document type",
}
"""Command lines, and what is said of them."""

FILES = {
    "text": "no record\n",
    "empty": "",
    "other.json": '{"benchmarks": [{"fullname": "t"}]}',
    "wrong.json": '{"benchmarks": 3}',
    "bad/records.jsonl": "no record\n",
    "scene.sdf": "<sdf/>",
    "scene.txt": "x",
    "open.xml": "<mujoco><worldbody></mujoco>",
    "entity.xml": '<!DOCTYPE a [<!ENTITY b "c">]><mujoco/>',
}


@pytest.fixture
def files(configure: Configure, monkeypatch: pytest.MonkeyPatch) -> None:
    """What the command lines name, and no environment of a simulator."""
    folder = Path.cwd()
    monkeypatch.setenv("SIMBENCH_ENVIRONMENTS", str(folder / "environments"))
    records = Path(__file__).parents[1] / "measure" / "stacking_records.jsonl"
    metrics = [Metric("landed", "landed", better="lower"), Metric("landing_x", "x", better=None),
               Metric("placed", "placed", kind="share", of=15)]  # fmt: skip
    said = TaskDescription("stacking", tuple(metrics)).to_dict()
    good = {
        "good/records.jsonl": records.read_text().splitlines()[0] + "\n",
        "good/tasks.jsonl": json.dumps(said) + "\n",
    }
    for name, text in {**FILES, **good}.items():
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    for name in ("a", "b"):
        wrapper(folder / name / "python")
    (folder / "link").symlink_to("nowhere/at/all")
    small_arm(folder, TOML.replace("2000.0", "-1")).rename(folder / "bad.toml")


def refusal(configure: Configure, words: str) -> str:
    """What is said of a command line before anything is collected: one sentence."""

    def begin() -> None:
        session = session_of(configure(*shlex.split(words)))
        session.check_options()
        session.pytest_sessionstart()

    with pytest.raises(pytest.UsageError) as raised:
        begin()
    told = str(raised.value)
    assert "\n" not in told
    if "/proc" not in words:  # which depends on the machine
        assert_approved_line("refused", f"{words:.80}: {told}".replace(str(Path.cwd()), "DIR"))
    return told


@pytest.mark.usefixtures("files")
@pytest.mark.parametrize("words", BAD)
def test_bad_option(configure: Configure, words: str) -> None:
    if "--sim-scene" in words:
        pytest.importorskip("mujoco")
    assert fnmatchcase(refusal(configure, words), f"*{BAD[words]}*")


@pytest.mark.parametrize(
    ("package", "option", "extra"),
    [("rosbags", "--sim-record=mcap", "ros"), ("av", "--sim-video=first", "video")],
)
def test_a_missing_package_is_told(
    configure: Configure,
    monkeypatch: pytest.MonkeyPatch,
    package: str,
    option: str,
    extra: str,
) -> None:
    find = importlib.util.find_spec
    for place in ("pytest_simbench.recordings.film.find_spec", "importlib.util.find_spec"):
        monkeypatch.setattr(place, lambda name: None if name == package else find(name))
    told = refusal(configure, option)
    assert told.startswith(f"{option}: ")
    assert told.endswith(f"pip install 'pytest-simbench[{extra}]'")


def test_a_bad_option_ends_the_run(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(CLAIMING)
    result = run_pytest(pytester, "--sim=mujocco")
    usage_error(result, "ERROR: unknown simulator 'mujocco'; choose from *, or all")


BAD_MARKS = [
    ("only_sim('mujocco')", "unknown simulator 'mujocco'; choose from *mujoco, *pybullet*"),
    ("skip_sim()", "skip_sim needs the name of a simulator"),
    ("skip_sim(['mujoco'])", "unknown simulator \"['mujoco']\"; choose from"),
    ("skip_sim('mujoco', reson='x')", "skip_sim has no keyword argument 'reson'; *reason"),
    ("only_sim('mujoco', strict=1)", "only_sim has no keyword argument 'strict'; *none"),
    ("xfail_sim('mujoco', reason=3)", "xfail_sim: reason must be a text"),
    ("needs('wings')", "needs('wings'): choose from *window*offscreen*"),
    ("needs()", "needs() without a capability: choose from *window*offscreen*"),
    ("reps(0)", "reps(0): give a whole number from 1 to 100000"),
    ("reps(1.5)", "reps(1.5): give a whole number from 1"),
    ("reps(2, 3)", "reps(2, 3): give one number"),
    ("sim_timeout('long')", "sim_timeout('long'): give a number from 0.001 to 1e+06"),
    ("sim_timeout(float('nan'))", "sim_timeout(nan): give a number from 0.001"),
]


def test_bad_marks_are_told_all_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tests = (
        f"@pytest.mark.{mark}\ndef test_{number}(repeat):\n    pass\n"
        for number, (mark, _) in enumerate(BAD_MARKS)
    )
    prepare(tmp_path, monkeypatch, "\n".join(["import pytest", *tests]))
    lines = run("").splitlines()
    assert "exit code 4" in lines
    for number, (_, message) in enumerate(BAD_MARKS):
        (told,) = (line for line in lines if f"::test_{number}: " in line)
        assert all(part in told for part in message.split("*")), told
        assert_approved_line("refused", told)
