"""Run inside Blender: the mesh cache modifier must reproduce every float of a point cache.

    blender --background --factory-startup --python-exit-code 1 --python read_cache.py -- OUT

OUT holds skin.obj, skin.pc2 and skin.json. The PC2 file is taken apart here with struct, independently of the
program that wrote it and of Blender, and every frame that Blender shows is compared with it bit for bit: once on
a mesh made from the lines of the OBJ file, once on the mesh that Blender's own OBJ importer makes.
"""
import array
import json
import os
import struct
import sys

import bpy


def read_pc2(path):
    with open(path, "rb") as stream:
        data = stream.read()
    magic, version, num_points, start, rate, num_samples = struct.unpack_from("<12siiffi", data)
    assert magic == b"POINTCACHE2\0" and version == 1, (magic, version)
    assert rate == 1.0, rate
    assert len(data) == 32 + 12 * num_points * num_samples, len(data)
    size = 12 * num_points
    return start, num_points, [data[32 + k * size : 32 + (k + 1) * size] for k in range(num_samples)]


def read_obj(path):
    vertices, faces = [], []
    with open(path, encoding="utf-8") as stream:
        for line in stream:
            words = line.split()
            if words and words[0] == "v":
                vertices.append(tuple(float(word) for word in words[1:4]))
            elif words and words[0] == "f":
                faces.append(tuple(int(word) - 1 for word in words[1:]))
    return vertices, faces


def positions(mesh):
    floats = array.array("f", bytes(12 * len(mesh.vertices)))
    mesh.vertices.foreach_get("co", floats)
    return floats.tobytes()


def check(obj, cache, first_frame, samples):
    modifier = obj.modifiers.new("cache", "MESH_CACHE")
    modifier.cache_format = "PC2"
    modifier.filepath = cache
    modifier.frame_start = first_frame
    modifier.forward_axis = "POS_Y"
    modifier.up_axis = "POS_Z"
    modifier.interpolation = "NONE"
    scene = bpy.context.scene
    # From the last to the first and then some in the middle: seeking, not only reading on.
    order = list(range(len(samples)))[::-1] + list(range(0, len(samples), 3))
    for k in order:
        scene.frame_set(first_frame + k)
        evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
        got = positions(evaluated.data)
        if got != samples[k]:
            wrong = [i for i in range(len(got) // 12) if got[12 * i : 12 * i + 12] != samples[k][12 * i : 12 * i + 12]]
            raise AssertionError(
                f"{obj.name}, frame {first_frame + k}: {len(wrong)} vertices differ, the first is {wrong[:1]}"
            )


def main():
    out = sys.argv[sys.argv.index("--") + 1]
    cache = os.path.abspath(os.path.join(out, "skin.pc2"))
    rest = os.path.abspath(os.path.join(out, "skin.obj"))
    with open(os.path.join(out, "skin.json"), encoding="utf-8") as stream:
        sidecar = json.load(stream)
    start, num_points, samples = read_pc2(cache)
    assert start == sidecar["first_frame"], (start, sidecar["first_frame"])
    assert len(samples) == sidecar["frame_count"] > 0
    vertices, faces = read_obj(rest)
    assert len(vertices) == num_points == sidecar["vertex_count"]

    mesh = bpy.data.meshes.new("from_lines")
    mesh.from_pydata(vertices, [], faces)
    obj = bpy.data.objects.new("from_lines", mesh)
    bpy.context.scene.collection.objects.link(obj)
    rest_bytes = positions(mesh)
    check(obj, cache, sidecar["first_frame"], samples)

    before = set(bpy.data.objects)
    bpy.ops.wm.obj_import(filepath=rest, forward_axis="Y", up_axis="Z")
    (imported,) = set(bpy.data.objects) - before
    assert positions(imported.data) == rest_bytes, "Blender's importer changed the order of the vertices"
    check(imported, cache, sidecar["first_frame"], samples)
    print(f"{len(samples)} frames of {num_points} vertices: equal bit for bit")


main()
