"""The rock that the blades of a drag bit leave behind: delay, lift-off, memory."""

import math

import numpy as np
import pytest

from cosserat_fenicsx.drilling.bit_laws import RockSurface

pytestmark = [pytest.mark.serial, pytest.mark.once]


def test_steady_drilling_cuts_the_advance_of_a_blade():
    slope, blades = 0.002 / (2 * math.pi), 4
    cut = 2 * math.pi * slope / blades
    rock = RockSurface(blades, slope=slope, cut=cut)
    for angle in np.linspace(0.01, 40.0, 400):
        assert abs(rock.pass_over(angle, slope * angle, slope) - cut) < 1e-15


def test_the_delayed_depth_of_a_vibrating_bit_is_interpolated_with_order_four():
    def error(places):
        rock = RockSurface(3)
        for angle in np.linspace(0.0, 6.0, places)[1:]:
            rock.pass_over(angle, angle + 0.2 * math.sin(2 * angle), 1 + 0.4 * math.cos(2 * angle))
        at = np.linspace(3.0, 5.9, 1717)
        return max(
            abs(rock.under(x)[0] - (y + 0.2 * math.sin(2 * y))) for x, y in zip(at, at - rock.pitch, strict=True)
        )

    assert 13 < error(61) / error(121) < 19


def test_rock_that_a_bit_jumps_over_remains():
    rock = RockSurface(2)
    for angle in np.linspace(0.0, 3.0, 31)[1:]:
        assert abs(rock.pass_over(angle, 0.01, 0.0) - 0.01) < 1e-15  # half a turn 10 mm deep
    for angle in np.linspace(3.0, 8.0, 51)[1:]:
        cut = rock.pass_over(angle, -0.005, 0.0)  # a turn above the rock
    assert abs(cut + 0.015) < 1e-12 and abs(rock.under(10.0)[0] - 0.01) < 1e-12


def test_recall_leads_to_the_same_digits():
    rock, again = RockSurface(4, slope=1e-3, cut=1e-3), RockSurface(4)
    path = [(0.1 * k, 1e-3 * math.sin(k), 1e-3 * math.cos(k)) for k in range(1, 40)]
    for place in path[:20]:
        rock.pass_over(*place)
    again.recall(rock.memory())
    assert [rock.pass_over(*x) for x in path[20:]] == [again.pass_over(*x) for x in path[20:]]
