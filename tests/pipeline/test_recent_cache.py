import numpy as np

from resdepth_colmap.pipeline.recent_cache import RecentCache
from resdepth_colmap.scene import FloatMap


def test_a_cache_holds_the_latest_and_no_more_than_it_may() -> None:
    cache = RecentCache(100)
    loaded: list[int] = []

    def get(number: int) -> FloatMap:
        def load() -> FloatMap:
            loaded.append(number)
            return np.full(10, number, np.float32)  # 40 bytes

        return cache.get(number, load)

    for number in (1, 2, 1, 3, 1, 2):
        assert (get(number) == number).all()
        assert cache.num_bytes <= 100
    assert loaded == [1, 2, 3, 2]  # 2 was the one that had not been asked for


def test_the_latest_is_kept_whatever_its_size() -> None:
    cache = RecentCache(10)
    first, second = (cache.get(0, lambda: np.zeros(9, np.float32)) for _ in range(2))
    assert first is second
    cache.get(1, lambda: np.zeros(9, np.float32))
    assert cache.num_bytes == 36
