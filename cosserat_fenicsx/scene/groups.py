"""Groups of things that are connected, directly or through others (union-find)."""


class Groups:
    """Groups of hashable things that can be ordered; the least of each group is its leader.

    Whatever was not joined yet is a group of its own.
    """

    def __init__(self):
        self._above = {}

    def leader(self, x):
        """The least member of the group of x."""
        above, up = self._above, self._above.get(x, x)
        while up != x:
            further = above.get(up, up)
            above[x] = further  # halves the way of later calls
            x, up = up, further
        return x

    def join(self, one, other):
        """Make one group of two; False where they are one already."""
        first, second = self.leader(one), self.leader(other)
        if first == second:
            return False
        first, second = sorted((first, second))
        self._above[second] = first
        return True

    def joined(self):
        """All members that are not the leaders of their groups."""
        return self._above.keys()
