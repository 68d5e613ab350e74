"""Valve families: the grid in which all stand in the same cells."""

from simbench.scenarios.grid import load_grid


def test_every_family_is_in_the_same_cells():
    grid = load_grid("families")
    for index in (0, 30, grid.cells - 1):
        group = grid.group(index)
        sticky = {
            d.tags["valve"]: d.loop
            for d in group.drafts
            if str(d.tags["member"]).startswith("sticky")
        }
        assert {"choudhury", "he", "kano", "coulomb", "karnopp", "stribeck"} <= set(sticky)
        # each loop has a separate gain and time scale: what has no unit is the same
        cells = {
            (
                f"{abs(x.plant.K * x.controller.Kc) * (1.0 if x.plant.T else x.controller.Ti):.9g}",
                f"{x.plant.Td / (x.plant.T or x.controller.Ti):.9g}",
                f"{x.controller.Ti / (x.plant.T or x.controller.Ti):.9g}",
            )
            for x in sticky.values()
        }
        assert len(cells) == 1
