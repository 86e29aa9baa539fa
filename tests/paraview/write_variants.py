"""Writes a grid in every way VTK knows. Usage: pvpython write_variants.py FILE.vtu FOLDER"""

import os
import sys

import vtk

reader = vtk.vtkXMLUnstructuredGridReader()
reader.SetFileName(sys.argv[1])
reader.Update()
folder = sys.argv[2]
os.makedirs(folder, exist_ok=True)

for mode in ("Binary", "Appended"):
    for compressed in (False, True):
        for encoded in (False, True):
            for big_endian in (False, True):
                for header in (32, 64):
                    for block in (512, 32768) if compressed else (32768,):
                        writer = vtk.vtkXMLUnstructuredGridWriter()
                        writer.SetInputData(reader.GetOutput())
                        getattr(writer, "SetDataModeTo" + mode)()
                        getattr(writer, "SetCompressorTypeTo" + ("ZLib" if compressed else "None"))()
                        writer.SetBlockSize(block)
                        writer.SetEncodeAppendedData(encoded)
                        getattr(writer, "SetByteOrderTo" + ("BigEndian" if big_endian else "LittleEndian"))()
                        getattr(writer, f"SetHeaderTypeToUInt{header}")()
                        name = f"{mode}-{compressed:d}{encoded:d}{big_endian:d}-{header}-{block}.vtu"
                        writer.SetFileName(os.path.join(folder, name))
                        assert writer.Write() == 1
for version in (42, 51):
    writer = vtk.vtkUnstructuredGridWriter()
    writer.SetInputData(reader.GetOutput())
    writer.SetFileVersion(version)
    writer.SetFileTypeToBinary()
    writer.SetFileName(os.path.join(folder, f"legacy-{version}.vtk"))
    assert writer.Write() == 1
