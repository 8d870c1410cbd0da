"""A limit to retries: the condition of type `Again`."""

import pytest
from readings import Bench


class TestAgain:
    """A car that is pushed from the first state to the second one, and back, as the distance grows."""

    def bench(self, **limits: object) -> Bench:
        forth = {"id": 0, "type": "Distance", "distance": 0.5, "from": "a", "to": "b"}
        end = {"id": 1, "type": "Again", "from": "b", "to": "end", **limits}
        back = {"id": 2, "type": "Distance", "distance": 0.1, "from": "b", "to": "a"}
        states = [{"id": i, "type": "Motor", "throttle": 0.2} for i in "ab"]
        return Bench(
            {"root": "a", "states": [*states, {"id": "end", "type": "Stop"}], "transitions": [forth, end, back]}
        )

    def driven(self, bench: Bench) -> float:
        """Way to the end; infinite: there is none within 10 m."""
        distance = 0.0
        while bench.active != "end" and distance < 10.0:
            bench.tick(distance=distance, speed=0.4)
            distance += 0.05
        return distance if bench.active == "end" else float("inf")

    def test_it_fires_at_the_second_entry(self) -> None:
        assert self.driven(self.bench()) == pytest.approx(1.2, abs=0.15)

    def test_farther_on_it_counts_anew(self) -> None:
        assert self.driven(self.bench(within=0.3)) == float("inf")

    def test_so_often_as_asked(self) -> None:
        assert self.driven(self.bench(times=3)) == pytest.approx(1.9, abs=0.2)

    def test_a_new_drive_counts_from_one(self) -> None:
        bench = self.bench()
        for distance in (0.0, 0.6):
            bench.tick(distance=distance, speed=0.4)
        bench.reset()
        assert self.driven(bench) == pytest.approx(1.2, abs=0.15)
