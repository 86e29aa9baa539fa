#!/usr/bin/env python3
"""Each rule of check_tree.py finds what it is there for, and nothing in a tree that keeps the rules."""

import os
import shutil
import tempfile
import unittest

import check_tree

GOOD = {
    "README.md": "# A tree\n\n![picture](assets/a.png) [a page](tools/manual/page.md#part), tools/shell/main.cpp\n",
    "tools/manual/page.md": "# A page\n\n[method](../../fem/METHOD.md), after [Gauss09]; `build/tools/x`, `fem/body`\n",
    "lattice/METHOD.md": "# Lattices\n\n- [Euler44] Methodus.\n",
    "fem/METHOD.md": "# Flesh\n\n[lattice](../lattice/METHOD.md)\n\n- [Gauss09] Theoria motus.\n",
    "assets/a.png": "picture",
    "lattice/cell.h": "#pragma once\n\n#include <vector>\n\n#include <Eigen/Core>\n",
    "lattice/detail/mesh.h": "#pragma once\n\n#include <CGAL/Mesh_3.h>\n",
    "lattice/cell.cpp": '#include "lattice/cell.h"\n\n#include <CGAL/Mesh_3.h>\n\n#include "lattice/detail/mesh.h"\n',
    "fem/body/body.h": '#pragma once\n\n#include "lattice/cell.h"\n',
    "fem/body/body.cpp": '#include "fem/body/body.h"\n\n#include <cholmod.h>\n\n#include "fem/body/body.h"\n',
    "tools/shell/main.cpp": '#include <sys/wait.h>\n#include <unistd.h>\n\n#include "fem/body/body.h"\n',
    "tests/fem/body_test.cpp": '#include <gtest/gtest.h>\n\n#include "fem/body/body.h"\n',
}


class CheckTree(unittest.TestCase):
    def setUp(self):
        self.root = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.root)
        for name, text in GOOD.items():
            self.write(name, text)

    def write(self, name, text):
        path = os.path.join(self.root, name)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "w", encoding="utf-8") as stream:
            stream.write(text)

    def offences(self, rule):
        return list(check_tree.RULES[rule](self.root))

    def expect(self, rule, *starts):
        found = self.offences(rule)
        self.assertEqual(len(found), len(starts), found)
        for offence, start in zip(found, starts):
            self.assertTrue(offence.startswith(start), offence)

    def test_a_good_tree_passes(self):
        for rule in ("layout", "includes", "words", "sizes", "references"):
            self.assertEqual(self.offences(rule), [], rule)

    def test_other_top_level_folders_are_found(self):
        self.write("docs/manual.md", "")
        self.write(".github/workflow.yml", "")  # dot folders are free
        self.write("build/junk.o", "")          # as is what is built
        self.expect("layout", "docs/manual.md:")

    def test_wrong_directions_are_found(self):
        self.write("assets/rig.cpp", '#include "fem/body/body.h"\n')
        self.write("lattice/down.cpp", '#include "fem/body/body.h"\n')
        self.write("fem/peek.cpp", '#include "lattice/detail/mesh.h"\n')
        self.expect("includes", 'assets/rig.cpp:1: "fem/body/body.h"', 'fem/peek.cpp:1: "lattice/detail/mesh.h"',
                    'lattice/down.cpp:1: "fem/body/body.h": lattice may include nobody else')

    def test_upward_includes_between_rooms_are_found(self):
        self.write("fem/linear/factor.cpp", '#include "fem/body/body.h"\n')
        self.write("fem/time/run.cpp", '#include "fem/body/body.h"\n#include "fem/body/detail/part.h"\n')
        self.write("fem/attic/old.cpp", "")
        self.write("fem/loose.cpp", "")
        self.expect("rooms", "fem/attic/old.cpp: lies in none", "fem/linear/factor.cpp:1:", "fem/loose.cpp: lies in none",
                    'fem/time/run.cpp:2: "fem/body/detail/part.h": internals of fem/body')

    def test_flags_and_terminals_in_libraries_are_found(self):
        self.write("lattice/hint.cpp", 'const char* hint = "try --soft-bones";\n// --soft-bones\nint x = 1; x--;\n')
        self.write("tools/session/talk.cpp", "#include <CLI/CLI.hpp>\nstd::cerr << 1;\n// on stdout\nprint(stderr, 2);\n")
        self.write("tools/shell/talk.cpp", 'std::cerr << "--help";\n')
        self.expect("terminal", "lattice/hint.cpp:1: a flag", "tools/session/talk.cpp:1:", "tools/session/talk.cpp:2:",
                    "tools/session/talk.cpp:4:")

    def test_includes_that_do_not_start_at_the_root_are_found(self):
        self.write("fem/near.cpp", '#include "body.h"\n')
        self.write("fem/gone.cpp", '#include "fem/gone.h"\n')
        self.expect("includes", 'fem/gone.cpp:1: "fem/gone.h"', 'fem/near.cpp:1: "body.h"')

    def test_libraries_outside_their_folder_are_found(self):
        self.write("skeleton/read.cpp", "#include <assimp/scene.h>\n")
        self.write("fem/unknown.cpp", "#include <boost/any.hpp>\n")
        self.expect("includes", "fem/unknown.cpp:1: <boost/any.hpp>", "skeleton/read.cpp:1: <assimp/scene.h>")

    def test_libraries_in_public_headers_are_found(self):
        self.write("fem/solver.h", "#pragma once\n#include <cholmod.h>\n")
        self.write("fem/forward.h", "#pragma once\nstruct cholmod_common_struct;\n")
        self.expect("includes", "fem/forward.h: cholmod_common_struct", "fem/solver.h:2: <cholmod.h>")

    def test_headers_without_guard_are_found(self):
        self.write("fem/open.h", "int f();\n")
        self.expect("includes", "fem/open.h: no #pragma once")

    def test_words_are_found(self):
        self.write("tools/a.cpp", "// TO" "DO later\n")
        self.write("tools/b.sh", 'cat "/' 'home/me/file"\n')
        self.write("tests/c.cpp", "GTEST_" "SKIP();\n")
        self.write("tools/d.cpp", "// https://example.org/" "home/page and ${prefix}/" "tmp/x are no such paths\n")
        self.expect("words", "tests/c.cpp:1:", "tools/a.cpp:1:", "tools/b.sh:1:")

    def test_long_and_heavy_files_are_found(self):
        self.write("fem/long.cpp", "\n" * 601)
        self.write("fem/excused.cpp", "// Long, as it is one table.\n" + "\n" * 601)
        self.write("assets/heavy.bin", "x" * 1_000_001)
        for i in range(4):
            self.write(f"assets/samples/{i}.glb", "x" * 800_000)
        self.expect("sizes", "assets/heavy.bin: 1000001 bytes", "fem/long.cpp: 601 lines", "assets/samples: 3200000")

    def test_long_pages_are_found(self):
        wide = "x " * 61
        self.write("README.md", "words " * 20 + "\n" + "a line\n" * 1270)
        self.write("tools/manual/page.md", f"# A page\n\n| {wide} |\n\n    {wide}\n\n```\n{wide}\n```\n"
                                           f"https://example.org {wide}\n{wide}\n")
        self.expect("sizes", "README.md: 9011 bytes, expected at most 9000", "tools/manual/page.md:11: 122 columns")

    def test_sources_that_are_not_listed_are_found(self):
        self.write("fem/law.cpp", "// [Gauss09, sec. 3], [Euler44], [Hooke78]\nint x = points[kHats12];\n")
        self.write("tools/manual/page.md", "As in [Newton87].\n\n- [Newton87] Listed here, where no reader looks.\n")
        self.expect("references", "fem/law.cpp:1: [Hooke78]", "tools/manual/page.md:1: [Newton87]",
                    "tools/manual/page.md:3: [Newton87]")

    def test_paths_that_are_not_there_are_found(self):
        self.write("README.md", "![picture](assets/b.png), run tools/go and `tests`\n")
        # Links start at the page's folder, names of files at the root of the tree.
        self.write("tools/manual/page.md", "[root](README.md) [up](../../README.md) [far](https://example.org/x)\n")
        self.write("fem/METHOD.md", "- [Gauss09] Theoria motus.\n\n| `fem/body/body.h`, `fem/body/gone.h` |\n")
        self.expect("references", "README.md:1: assets/b.png", "README.md:1: tools/go",
                    "fem/METHOD.md:3: fem/body/gone.h", "tools/manual/page.md:1: README.md")


if __name__ == "__main__":
    unittest.main()
