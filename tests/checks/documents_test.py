#!/usr/bin/env python3
"""What the documents tell people to type works: the commands of README.md and of every page in tools/manual exist, with
the options they are given; the scene files of tools/manual/scenes.md are read; the lines of "Five minutes" run.
Usage: documents_test.py ROOT SINEW"""

import glob
import os
import re
import shlex
import subprocess
import sys
import tempfile
import unittest

ROOT, SINEW = os.path.abspath(sys.argv.pop(1)), os.path.abspath(sys.argv.pop(1))
README = os.path.join(ROOT, "README.md")
MANUAL = sorted(glob.glob(os.path.join(ROOT, "tools/manual/*.md")))
SCENES = os.path.join(ROOT, "tools/manual/scenes.md")


def read(page):
    with open(page, encoding="utf-8") as stream:
        return stream.read()


def code_lines(text):
    return [line[4:].rstrip() for line in text.splitlines() if line.startswith("    ")]


def scene_file(first_line):
    """The lines of a scene file that the manual shows, up to the next command."""
    lines = code_lines(read(SCENES))
    first = next(i for i, line in enumerate(lines) if line.startswith(first_line))
    last = next((i for i in range(first, len(lines)) if lines[i].startswith("sinew ")), len(lines))
    return "\n".join(lines[first:last]) + "\n"


def section(text, title):
    return re.search(rf"^## {title}\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)[1]


class Documents(unittest.TestCase):
    def test_commands_and_their_options_exist(self):
        self.assertGreater(len(MANUAL), 5)
        known = {}
        commands = set()
        for page in [README, *MANUAL]:
            for line in code_lines(read(page)):
                if not line.startswith("sinew "):
                    continue
                words = shlex.split(line, comments=True)
                commands.add(words[1])
                if words[1] not in known:
                    shown = subprocess.run([SINEW, words[1], "--help"], capture_output=True, text=True, check=False)
                    self.assertEqual(shown.returncode, 0, line + "\n" + shown.stderr)
                    known[words[1]] = set(re.findall(r"(?<![\w-])--?[a-z][\w-]*", shown.stdout))
                for option in (word for word in words[2:] if word.startswith("-")):
                    self.assertIn(option, known[words[1]], f"{os.path.relpath(page, ROOT)}: {line}")
        self.assertEqual(commands, {"inspect", "simulate", "pose", "lattice", "ladder", "compare"})

    def print_scene(self, text):
        with tempfile.TemporaryDirectory() as folder:
            scene = os.path.join(folder, "scene.toml")
            with open(scene, "w", encoding="utf-8") as stream:
                stream.write(text)
            shown = subprocess.run([SINEW, "simulate", scene, "--print-scene"], capture_output=True, text=True,
                                   check=False)
        self.assertEqual((shown.returncode, shown.stderr), (0, ""))
        return shown.stdout

    def test_the_scene_file_is_read(self):
        shown = self.print_scene(scene_file("# hopper.toml"))
        self.assertIn('\nbones = ["tail*", "ear*"]\nyoung = 4000\n', shown)
        self.assertIn("\ndamping = 0.08\n", shown)

    def test_the_scene_without_a_rig_and_its_loads_are_read(self):
        shown = self.print_scene(scene_file("# elbow.toml") + scene_file("[[point_load]]"))
        for table in ("[lattice]", "[[bone]]", "[[fixed]]", "[[point_load]]", "[[body_load]]", "[[face_load]]",
                      "[velocity]"):
            self.assertIn("\n" + table + "\n", shown)

    def test_five_minutes_run_as_typed(self):
        lines = code_lines(section(read(README), "Five minutes"))
        self.assertGreater(len(lines), 5)
        # The first line is for the clone: there the command is the release build's and may not be built.
        self.assertEqual(lines[0], 'export PATH="$PWD/build/release/tools:$PATH" RIGS="$PWD/assets/samples"')
        environment = dict(os.environ, PATH=os.path.dirname(SINEW) + ":" + os.environ["PATH"],
                           RIGS=os.path.join(ROOT, "assets/samples"))
        with tempfile.TemporaryDirectory() as folder:
            for line in lines[1:]:
                ran = subprocess.run(["bash", "-e", "-c", line], cwd=folder, env=environment, capture_output=True,
                                     text=True, check=False)
                self.assertEqual(ran.returncode, 0, line + "\n" + ran.stderr)
            self.assertTrue(os.path.exists(os.path.join(folder, "hop/preview.png")))
            self.assertTrue(os.path.exists(os.path.join(folder, "hopper.vtu.png")))


if __name__ == "__main__":
    unittest.main()
