"""A simulator that is a program of its own: MuJoCo behind a socket, as Webots or CoppeliaSim are.

Run as a script: `mujoco_program.py SOCKET`. It serves one client, which sends the name of what it
wants and the arguments, and steps only when it is asked to. The environment names what it does
wrong, see `Outside`.
"""

from __future__ import annotations

import os
import sys
import time
from multiprocessing.connection import Connection, Listener
from typing import Any

from pytest_simbench.sims.mujoco.adapter import MuJoCo
from pytest_simbench.sims.mujoco.settings import MuJoCoSettings

from pytest_simbench.scene import Scene

FAULT_STEP = 100
"""After how many steps a fault happens that is not one of starting."""


class World:
    """What the client may ask for, beside the methods of MuJoCo's adapter.

    Args:
        fault: that is planted; empty for none.
    """

    def __init__(self, fault: str) -> None:
        self.fault, self.steps = fault, 0

    def build(self, settings: dict[str, Any], scene: dict[str, Any]) -> None:
        if self.fault == "refuses":
            raise ValueError("there is no such thing as a cube")
        self.simulator = MuJoCo(MuJoCoSettings(**settings))
        self.simulator.load(Scene.from_wire(scene))

    def make_steps(self, steps: int) -> int:
        if self.fault == "drifts" and self.steps >= FAULT_STEP:
            steps += 1
        for _ in range(steps):
            self.simulator.step()
        self.steps += steps
        return self.steps

    def save(self) -> Any:
        return self.steps, self.simulator.save()

    def restore(self, state: Any) -> None:
        self.steps, inside = state
        self.simulator.restore(inside)

    def contact_forces(self) -> list[Any]:
        return list(self.simulator.contact_forces())

    def __getattr__(self, name: str) -> Any:
        return getattr(self.simulator, name)


def serve(connection: Connection, world: World) -> None:
    """Answer until the client asks to end: (True, result) or (False, what was raised)."""
    while True:
        name, *arguments = connection.recv()
        if name == "end":
            return
        if world.fault == "babbles" and world.steps >= FAULT_STEP:
            connection.send_bytes(b"garbage")
        try:
            connection.send((True, getattr(world, name)(*arguments)))
        except Exception as error:
            print(f"{name} failed", flush=True)
            connection.send((False, str(error)))


def main(socket: str) -> None:
    fault = os.environ["OUTSIDE_FAULT"]
    print("MuJoCo begins", flush=True)
    if fault == "exits":
        sys.exit("no licence for today")
    if fault == "hangs":
        time.sleep(600)
    if fault == "chatters":
        os.write(1, b"\xff\x00garbage\n" * 10_000)
    with Listener(socket) as listener, listener.accept() as connection:
        serve(connection, World(fault))


if __name__ == "__main__":
    main(*sys.argv[1:])
