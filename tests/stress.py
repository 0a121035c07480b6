"""What short and long tests do to a store while processes fill it: kill them, remove and damage files."""

from __future__ import annotations

import random
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from csm.data.entries import read_entry
from csm.data.prepare import Job, Recipe, prepare, prepare_mesh
from csm.data.registry import recognise
from csm.data.store import Store
from csm.descriptors import ACD
from tests.toyset import write_toys

RECIPE = Recipe(ACD(angles=8, k=40, order=6), 40)
FILL = "import sys; from tests import stress\nif __name__ == '__main__': stress.fill(*sys.argv[1:])"


def fill(toys: str, store: str, workers: str = "0") -> None:
    """Prepare all shapes of a folder; run in a process of its own."""
    shapes = recognise(toys)
    jobs = [Job(shapes, name) for name in shapes.names]
    summary = prepare(jobs, [RECIPE], Store(store), workers=int(workers), progress=False)
    assert summary.failures == [], summary.table()


class Filling:
    """A folder of toys, a store that processes fill, and one that was filled undisturbed, to compare with."""

    def __init__(self, folder: Path, n_shapes: int, seed: int) -> None:
        self.toys = write_toys(folder / "toys", n_shapes, 3)
        self.store, self.sound = Store(folder / "store"), Store(folder / "sound")
        self.random = random.Random(seed)
        begun = time.monotonic()
        self.run(self.sound)
        self.seconds = time.monotonic() - begun

    def start(self, store: Store | None = None, workers: int = 0) -> subprocess.Popen[bytes]:
        """Start a process that fills a store."""
        arguments = [str(self.toys), str((store or self.store).root), str(workers)]
        return subprocess.Popen([sys.executable, "-c", FILL, *arguments])

    def run(self, store: Store | None = None) -> None:
        """Fill a store to the end."""
        assert self.start(store).wait(600) == 0

    def kill(self, times: int, processes: int) -> None:
        """Kill processes that fill one store at random moments, each time starting another one."""
        running = [self.start() for _ in range(processes)]
        for _ in range(times):
            time.sleep(self.random.uniform(0, self.seconds))
            victim = self.random.choice(running)
            victim.kill()
            victim.wait()
            running[running.index(victim)] = self.start(workers=self.random.choice([0, 2]))
        assert [process.wait(600) for process in running] == [0] * processes

    def disturb(self, harm: Callable[[], object], every: float) -> None:
        """Do harm to the store again and again while a process fills it, and see that it ends well all the same."""
        process = self.start()
        while process.poll() is None:
            time.sleep(self.random.uniform(0, 2 * every))
            harm()
        assert process.returncode == 0

    def remove(self) -> None:
        """Remove the whole store."""
        shutil.rmtree(self.store.root, ignore_errors=True)

    def damage(self) -> None:
        """Cut a file of the store, change one of its bytes, or put another one in its place."""
        files = self.store.files()
        if not files:
            return
        path, other = self.random.choice(files), self.random.choice(files)
        content = bytearray(path.read_bytes())
        how = self.random.choice(["cut", "flip", "swap"])
        if how == "flip":
            content[self.random.randrange(len(content))] ^= 1 << self.random.randrange(8)
        temporary = path.with_suffix(".harm")
        temporary.write_bytes({"cut": content[: len(content) // 2], "flip": content, "swap": other.read_bytes()}[how])
        temporary.replace(path)

    def assert_equal_to_undisturbed(self) -> None:
        """Compare all entries bit for bit with those of the store that was left in peace."""
        names = [path.relative_to(self.sound.root) for path in self.sound.files()]
        assert names
        assert [path.relative_to(self.store.root) for path in self.store.files()] == names
        for name in names:
            wanted, found = (read_entry(store.root / name)[1] for store in (self.sound, self.store))
            assert list(found) == list(wanted)
            for key, array in wanted.items():
                np.testing.assert_array_equal(found[key], array)

    def read_all(self) -> None:
        """Load every shape, which computes again what is damaged."""
        shapes = recognise(self.toys)
        for name in shapes.names:
            prepare_mesh(shapes.mesh(name), RECIPE, self.store)
