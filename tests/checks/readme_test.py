#!/usr/bin/env python3
"""The commands that the README prints exist, with the options it gives them; so do the keys of its scene file.
Usage: readme_test.py ROOT SINEW"""

import os
import re
import shlex
import subprocess
import sys
import tempfile
import unittest

ROOT, SINEW = os.path.abspath(sys.argv.pop(1)), os.path.abspath(sys.argv.pop(1))


def code_lines():
    with open(os.path.join(ROOT, "README.md"), encoding="utf-8") as stream:
        return [line[4:].rstrip() for line in stream if line.startswith("    ")]


class Readme(unittest.TestCase):
    def test_commands_and_their_options_exist(self):
        lines = [line for line in code_lines() if line.startswith("sinew ")]
        self.assertGreater(len(lines), 5)
        for line in lines:
            words = shlex.split(line, comments=True)
            shown = subprocess.run([SINEW, words[1], "--help"], capture_output=True, text=True, check=False)
            self.assertEqual(shown.returncode, 0, line + "\n" + shown.stderr)
            known = set(re.findall(r"(?<![\w-])--?[a-z][\w-]*", shown.stdout))
            for option in (word for word in words[2:] if word.startswith("-")):
                self.assertIn(option, known, line)

    def test_the_scene_file_is_read(self):
        lines = code_lines()
        first = next(i for i, line in enumerate(lines) if line.startswith("# hopper.toml"))
        last = next(i for i in range(first, len(lines)) if lines[i].startswith("sinew "))
        with tempfile.TemporaryDirectory() as folder:
            scene = os.path.join(folder, "hopper.toml")
            with open(scene, "w", encoding="utf-8") as stream:
                stream.write("\n".join(lines[first:last]))
            shown = subprocess.run([SINEW, "simulate", scene, "--print-scene"], capture_output=True, text=True,
                                   check=False)
        self.assertEqual((shown.returncode, shown.stderr), (0, ""))
        self.assertIn('\nbones = ["tail*", "ear*"]\nyoung = 4000\n', shown.stdout)
        self.assertIn("\ndamping = 0.08\n", shown.stdout)


if __name__ == "__main__":
    unittest.main()
