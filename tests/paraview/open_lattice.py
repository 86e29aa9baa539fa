"""Opens a lattice in ParaView and checks its cells, fields and their ranges. Usage: pvpython open_lattice.py FILE"""

import itertools
import math
import sys

import numpy as np
from paraview.simple import OpenDataFile, MeshQuality, UpdatePipeline
from paraview.servermanager import Fetch

reader = OpenDataFile(sys.argv[1])
UpdatePipeline(proxy=reader)
grid = Fetch(reader)

types = [grid.GetCellType(c) for c in range(grid.GetNumberOfCells())]
tetrahedra = [c for c, t in enumerate(types) if t == 10]
lines = [c for c, t in enumerate(types) if t == 4]
assert len(tetrahedra) + len(lines) == len(types), set(types)
assert 240 <= len(tetrahedra) <= 360, len(tetrahedra)
assert len(lines) == 2, lines  # the arm's bones


def values(name):
    array = grid.GetCellData().GetArray(name)
    assert array is not None, name
    assert array.GetNumberOfTuples() == len(types), name
    return [array.GetTuple1(c) for c in range(len(types))]


# Fields lie where they must, and belong to the cells: measured anew, they come out the same.
for name, low, high in [("dihedral", 8.0, 70.53), ("scaled_jacobian", 0.08, 0.7072), ("fill", 0.0, 1.0),
                        ("level", 0, 0), ("region", 0, 10), ("frame", 0, 10), ("bone", -1, -1)]:
    of_cells = [values(name)[c] for c in tetrahedra]
    assert all(low - 1e-9 <= v <= high + 1e-9 for v in of_cells), (name, min(of_cells), max(of_cells))
assert max(values("fill")) > 0.3
assert sorted(values("bone")[c] for c in lines) == [0, 1]
assert all(math.isnan(v) or v == -1.0 for v in (values("dihedral")[c] for c in lines))
bone = grid.GetPointData().GetArray("bone")
assert bone.GetNumberOfTuples() == grid.GetNumberOfPoints() and bone.GetRange() == (-1, 1)

quality = MeshQuality(Input=reader)
quality.TetQualityMeasure = "Volume"
UpdatePipeline(proxy=quality)
theirs = Fetch(quality).GetCellData().GetArray("Quality")
worst = max(abs(theirs.GetTuple1(c) / values("volume")[c] - 1.0) for c in tetrahedra)
assert worst < 1e-9, worst


# ParaView 5.11's own minimum dihedral angle overlooks one of the six edges.
def smallest_dihedral(cell):
    points = [np.array(grid.GetPoint(grid.GetCell(cell).GetPointId(k))) for k in range(4)]
    angles = []
    for a, b in itertools.combinations(range(4), 2):
        edge = (points[b] - points[a]) / np.linalg.norm(points[b] - points[a])
        sides = [points[k] - points[a] for k in range(4) if k not in (a, b)]
        u, v = [side - side.dot(edge) * edge for side in sides]
        angles.append(math.degrees(math.acos(u.dot(v) / np.linalg.norm(u) / np.linalg.norm(v))))
    return min(angles)


assert all(abs(smallest_dihedral(c) - values("dihedral")[c]) < 1e-9 for c in tetrahedra[::10])
print(f"{len(tetrahedra)} cells: cells, fields and ranges hold")
