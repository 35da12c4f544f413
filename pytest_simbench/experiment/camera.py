"""The engine's own renderer, pointed at one repetition: pictures for its album, and its film."""

from __future__ import annotations

from collections.abc import Collection

from pytest_simbench.client.answers import Frame
from pytest_simbench.client.world import World
from pytest_simbench.recordings.film import PERIOD, SIZE, Album, Film


class Camera:
    """Takes pictures as a world goes on. They cost time and memory beside the simulation's.

    Args:
        album: gets a picture at the end of each phase, and one of each moment.
        film: gets all from the first phase to the last.
        within: phases in which moments may happen. The task tells of them later, so
            everything is filmed there.

    Attributes:
        problem: why there are no more pictures, as a sentence.
    """

    def __init__(
        self, album: Album | None = None, film: Film | None = None, within: Collection[str] = ()
    ) -> None:
        self.album = album
        self.film = film
        self.problem = ""
        self._within = within if album is not None else ()
        self._phase = ""
        self._rolls = False

    def enter(self, world: World, phase: str) -> None:
        """A phase begins."""
        self._phase = phase
        wanted = not self.problem and (self.film is not None or phase in self._within)
        if wanted != self._rolls:
            world.film(self._take if wanted else None, PERIOD, SIZE)
            self._rolls = wanted

    def leave(self, world: World, phase: str) -> None:
        """A phase has ended well."""
        if self.album is not None:
            self.album.look(phase, world.time, world.render)

    def finish(self, world: World | None, keep: bool) -> None:
        """The repetition is over, well or badly; `keep` its film."""
        if self.album is not None and world is not None:
            for moment, time in world.moments:
                self.album.find(moment, time)
        if self.film is not None:
            self.film.finish(keep)
            self.problem = self.problem or self.film.problem

    def _take(self, frame: Frame) -> None:
        """In a thread of the connection, while the world moves."""
        if frame.picture is None:
            self.problem = frame.problem
            return
        if self.film is not None:
            self.film.take(frame.time, frame.picture)
        if self._phase in self._within and self.album is not None:
            self.album.glance(frame.time, frame.picture)
