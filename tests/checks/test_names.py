#!/usr/bin/env python3
"""No two tests of a build share a name: labels go by names, so one of a pair would take the other's.
Usage: test_names.py BUILD_DIR CTEST"""

import collections
import re
import subprocess
import sys

listed = subprocess.run([sys.argv[2], "--test-dir", sys.argv[1], "-N"], capture_output=True, text=True, check=True).stdout
names = collections.Counter(re.findall(r"^ *Test +#\d+: (.*)$", listed, re.MULTILINE))
shared = sorted(name for name, count in names.items() if count > 1)
for name in shared:
    print(f"{name}: {names[name]} tests have this name")
if not names:
    print("no test is listed")
sys.exit(1 if shared or not names else 0)
