#!/usr/bin/env python3
"""What tools/quickstart, tools/test, tools/tables and .ci/run say and call, with the programs they call replaced by recorders."""

import datetime
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

SOURCE = os.path.abspath(sys.argv.pop(1)) if len(sys.argv) > 1 else os.getcwd()

# Each recorder writes its name and arguments to $CALLS, then does what the test lets it do.
RECORDER = """#!/bin/bash
echo "$(basename "$0") $*" >>"$CALLS"
"""


class Scripts(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)
        self.root = os.path.join(self.folder, "sinew")
        self.programs = os.path.join(self.folder, "bin")
        self.calls_file = os.path.join(self.folder, "calls")
        os.makedirs(self.programs)
        for name in ("tools/quickstart", "tools/test", "tools/tables", "tools/setup.bash", "tools/packages.txt",
                     ".ci/run"):
            os.makedirs(os.path.dirname(os.path.join(self.root, name)), exist_ok=True)
            shutil.copy(os.path.join(SOURCE, name), os.path.join(self.root, name))
        for name in ("cmake", "ctest", "apt-get"):
            self.program(name, "")
        self.program("sudo", 'exec "$@"')
        self.installed("echo installed")
        self.program("apt-cache", "echo '  Candidate: 1.0'")
        # The built command, as the recorded cmake builds nothing.
        os.makedirs(os.path.join(self.root, "build/release/tools"))
        self.program("sinew", '[[ -d out ]] && mkdir -p out/hopper && touch out/hopper/preview.png',
                     os.path.join(self.root, "build/release/tools"))

    def program(self, name, body, folder=None):
        path = os.path.join(folder or self.programs, name)
        with open(path, "w", encoding="utf-8") as stream:
            stream.write(RECORDER + body + "\n")
        os.chmod(path, 0o755)

    def installed(self, body):
        self.program("dpkg-query", body)

    def run_script(self, *command):
        environment = dict(os.environ, PATH=self.programs + ":" + os.environ["PATH"], CALLS=self.calls_file)
        result = subprocess.run([os.path.join(self.root, command[0]), *command[1:]], env=environment,
                                capture_output=True, text=True, check=False)
        self.calls = []
        if os.path.exists(self.calls_file):
            with open(self.calls_file, encoding="utf-8") as stream:
                self.calls = [line for line in stream.read().splitlines() if not line.startswith("dpkg-query")]
        return result

    def called(self, program):
        return [call for call in self.calls if call.split(" ")[0] == program]

    def expect_failure(self, result, exit_code, line):
        self.assertEqual((result.returncode, result.stderr), (exit_code, line + "\n"))

    def test_help_and_unknown_options(self):
        for script in ("tools/quickstart", "tools/test"):
            name = os.path.basename(script)
            result = self.run_script(script, "--help")
            self.assertEqual(result.returncode, 0)
            self.assertTrue(result.stdout.startswith(f"usage: tools/{name} "), result.stdout)
            self.expect_failure(self.run_script(script, "--fast"), 2,
                                f"{name}: unknown option --fast; see tools/{name} --help")
        self.expect_failure(self.run_script("tools/test", "--preset", "fast"), 2,
                            "test: --preset: got fast, expected release, dev, asan or ci")
        self.assertEqual(self.calls, [])

    def test_quickstart_builds_simulates_and_names_the_picture(self):
        result = self.run_script("tools/quickstart")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        for number in range(1, 5):
            self.assertIn(f"[{number}/4] ", result.stdout)
        self.assertEqual(self.called("sinew"),
                         ["sinew simulate assets/samples/hopper.glb -o out/hopper --overwrite"])
        self.assertIn("  out/hopper/preview.png\n", result.stdout)
        self.assertIn("Look at out/hopper/preview.png", result.stdout)

    def test_nothing_is_installed_where_nothing_is_missing(self):
        for script in ("tools/quickstart", "tools/test"):
            self.run_script(script)
            self.assertEqual(self.called("apt-get"), [])

    def test_only_what_is_missing_is_installed(self):
        self.installed('[[ $* == *" libfmt-dev" ]] || echo installed')
        self.assertEqual(self.run_script("tools/test").returncode, 0)
        calls = self.called("apt-get")
        self.assertEqual([call.split(" ")[4] for call in calls], ["update", "install"])
        self.assertTrue(calls[1].endswith("install -y --no-install-recommends libfmt-dev"), calls[1])

    def test_large_packages_are_wanted_by_all_only(self):
        self.installed('[[ $* == *" blender" || $* == *" python3-paraview" ]] || echo installed')
        self.run_script("tools/test")
        self.assertEqual(self.called("apt-get"), [])
        self.assertTrue(self.called("ctest")[0].endswith("--label-exclude ^(bench|nightly|blender|paraview|shared)$"))
        self.run_script("tools/test", "--all")
        self.assertTrue(self.called("apt-get")[-1].endswith(" blender python3-paraview"))
        self.assertTrue(self.called("ctest")[1].endswith("--label-exclude ^(bench|nightly|shared)$"))

    def test_shared_tests_run_where_the_folder_is(self):
        result = self.run_script("tools/test")
        self.assertIn("../shared is absent: the tests that read it (label shared) are left out\n", result.stdout)
        os.mkdir(os.path.join(self.folder, "shared"))
        result = self.run_script("tools/test")
        self.assertNotIn("absent", result.stdout)
        self.assertTrue(self.called("ctest")[1].endswith("--label-exclude ^(bench|nightly|blender|paraview)$"))

    def test_ci_demands_the_shared_folder_and_runs_everything(self):
        self.expect_failure(self.run_script(".ci/run"), 5,
                            ".ci/run: ../shared is missing; the tests that read it are part of this run")
        os.mkdir(os.path.join(self.folder, "shared"))
        self.assertEqual(self.run_script(".ci/run").returncode, 0)
        self.assertEqual(self.called("ctest")[0].split(" ")[1:3], ["--test-dir", "build/ci"])
        self.assertTrue(self.called("ctest")[0].endswith("--label-exclude ^(bench|nightly)$"))

    def page(self, name, text=None):
        path = os.path.join(self.root, "tests/measured", name)
        if text is not None:
            os.makedirs(os.path.dirname(path), exist_ok=True)
            with open(path, "w", encoding="utf-8") as stream:
                stream.write(text)
        with open(path, encoding="utf-8") as stream:
            return stream.read()

    def bench(self, name, body):
        self.program(name, body, os.path.join(self.root, "build/release/tools"))

    def commit(self, name, changes=""):
        self.program("git", f'[[ $1 == rev-parse ]] && echo {name} || echo "{changes}"')

    def test_tables_are_replaced_between_their_marks(self):
        old = "a\n\n<!-- table {} -->\n\n*2001-02-03, commit 1234567*\n\n| old |\n\n<!-- /table -->\n\nb\n"
        head = "| oracle | `x` | 2001-02-03 | 1234567 |\n| models | `y` | 2001-02-03 | 1234567 |\n\n"
        self.page("one.md", head + old.format("oracle") + old.format("models"))
        self.page("two.md", old.format("bar"))
        self.bench("oracle_bench", "echo '| new |'")
        self.commit("89abcde")
        result = self.run_script("tools/tables", "--only", "oracle")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        today = datetime.date.today().isoformat()
        new = old.replace("old", "new").replace("2001-02-03", today).replace("1234567", "89abcde")
        self.assertEqual(self.page("one.md"),
                         head.replace("2001-02-03 | 1234567", today + " | 89abcde", 1)
                         + new.format("oracle") + old.format("models"))
        self.assertEqual(self.page("two.md"), old.format("bar"))
        self.assertIn("cmake --build --preset release --target oracle_bench", self.called("cmake"))
        self.assertIn("written: tests/measured/one.md; git diff tests/measured shows", result.stdout)

    def test_tables_of_a_tree_with_changes_say_so(self):
        self.page("one.md", "<!-- table oracle -->\n\n<!-- /table -->\n")
        self.bench("oracle_bench", "echo '| new |'")
        self.commit("89abcde", " M fem/body.cpp")
        self.assertEqual(self.run_script("tools/tables", "--only", "oracle").returncode, 0)
        self.assertIn(", commit 89abcde with changes*\n\n| new |\n", self.page("one.md"))

    def test_tables_hold_what_tests_kept(self):
        self.page("one.md", "<!-- table bar -->\n\n<!-- /table -->\n")
        values = [f"sag_{level}" for level in (1, 2, 3)] + ["release_1", "release_2"]
        values += [f"mode_{level}_{mode}" for level in (1, 2) for mode in range(6)]
        kept = "".join(f'<property name="{name}" value="of {name}"/>' for name in values)
        self.bench("fem_reference_test", f"echo '{kept}' >\"${{2#--gtest_output=xml:}}\"")
        result = self.run_script("tools/tables", "--only", "bar")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        self.assertIn("| sag under its weight | of sag_1 % | of sag_2 % | of sag_3 % |", self.page("one.md"))

    def test_tables_are_all_made_or_none_is_written(self):
        first, second = "<!-- table oracle -->\n\n<!-- /table -->\n", "<!-- table bar -->\n\n<!-- /table -->\n"
        self.page("one.md", first)
        self.page("two.md", second)
        self.bench("oracle_bench", "echo '| new |'")
        self.bench("fem_reference_test", "exit 1")
        result = self.run_script("tools/tables", "--only", "oracle,bar")
        self.assertEqual(result.returncode, 1)
        self.assertTrue(result.stderr.startswith("tables: ") and result.stderr.count("\n") == 1, result.stderr)
        self.assertIn("fem_reference_test failed with exit code 1", result.stderr)
        self.bench("fem_reference_test", 'echo >"${2#--gtest_output=xml:}"')
        result = self.run_script("tools/tables", "--only", "oracle,bar")
        self.assertEqual((result.returncode, result.stderr), (1, "tables: table bar: no test kept 'sag_1'\n"))
        self.assertEqual((self.page("one.md"), self.page("two.md")), (first, second))

    def test_tables_refuse_a_table_that_is_not(self):
        result = self.run_script("tools/tables", "--only", "weather")
        self.assertEqual(result.returncode, 2)
        self.assertIn("--only: got weather, expected models, speed,", result.stderr)
        marks = "<!-- table oracle -->\n\n<!-- /table -->\n"
        self.bench("oracle_bench", "echo '| new |'")
        for one, two, got in (("no marks\n", "none\n", 0), (marks, marks, 2)):
            self.page("one.md", one)
            self.page("two.md", two)
            result = self.run_script("tools/tables", "--only", "oracle")
            self.assertEqual((result.returncode, result.stderr),
                             (1, "tables: tests/measured/*.md: expected one pair <!-- table oracle --> ... "
                                 f"<!-- /table -->, got {got}\n"))

    def test_no_install_names_what_is_missing(self):
        self.installed('[[ $* == *" libfmt-dev" || $* == *" cmake" ]] || echo installed')
        self.expect_failure(self.run_script("tools/quickstart", "--no-install"), 5,
                            "quickstart: not installed: cmake libfmt-dev (leave out --no-install, or apt-get install "
                            "them)")
        self.assertEqual(self.calls, [])

    def test_a_package_that_no_list_has_is_named(self):
        self.installed('[[ $* == *" libfmt-dev" ]] || echo installed')
        self.program("apt-cache", "echo '  Candidate: (none)'")
        self.expect_failure(self.run_script("tools/quickstart"), 5,
                            "quickstart: Debian package libfmt-dev cannot be had: no package list of this machine has it")

    def test_a_failing_apt_is_reported_on_one_line(self):
        self.installed('[[ $* == *" libfmt-dev" ]] || echo installed')
        self.program("apt-get", "echo 'Reading lists'; echo 'E: no network'; echo 'E: more'; exit 100")
        log = os.path.join(self.root, "build/packages.log")
        self.expect_failure(self.run_script("tools/test"), 5,
                            f"test: apt-get update failed: E: no network; the whole log is {log}")

    def test_a_failing_configure_is_reported_on_one_line(self):
        self.program("cmake", "echo 'CMake Error at CMakeLists.txt:1:'; echo '  no Eigen'; exit 1")
        result = self.run_script("tools/test")
        self.assertEqual(result.returncode, 1)
        self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        self.assertIn("test: configuring failed: CMake Error at CMakeLists.txt:1:   no Eigen ", result.stderr)

    def test_a_failing_build_or_test_fails_the_script(self):
        self.program("ctest", "exit 8")
        self.assertEqual(self.run_script("tools/test").returncode, 8)
        self.program("cmake", "[[ $1 != --build ]]")
        self.assertNotEqual(self.run_script("tools/test").returncode, 0)
        self.assertEqual(len(self.called("ctest")), 1)


if __name__ == "__main__":
    unittest.main()
