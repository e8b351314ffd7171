"""What was loaded last stays in memory: a least-recently-used cache of arrays."""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, Protocol, TypeVar


class HasBytes(Protocol):
    """An array, or something made of arrays."""

    @property
    def nbytes(self) -> int:
        """Memory of the arrays."""


Item = TypeVar("Item", bound=HasBytes)


class RecentCache:
    """Keeps the latest items, up to so many bytes in all, but at least one.

    A key stands for items of one type.

    Attributes:
        max_num_bytes: When there are more, the items not asked for longest go.
    """

    def __init__(self, max_num_bytes: int) -> None:
        """Keep nothing yet."""
        self.max_num_bytes = max_num_bytes
        self._items: OrderedDict[Hashable, Any] = OrderedDict()

    @property
    def num_bytes(self) -> int:
        """Memory of what is kept."""
        return sum(int(item.nbytes) for item in self._items.values())

    def get(self, key: Hashable, load: Callable[[], Item]) -> Item:
        """The item of that key; what `load` returns if it is not kept."""
        if key not in self._items:
            self._items[key] = load()
        self._items.move_to_end(key)
        while len(self._items) > 1 and self.num_bytes > self.max_num_bytes:
            self._items.popitem(last=False)
        item: Item = self._items[key]
        return item
