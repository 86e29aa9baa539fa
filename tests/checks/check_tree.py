#!/usr/bin/env python3
"""Rules of the tree that no compiler checks. Usage: check_tree.py ROOT RULE; prints every offence, exits 1 if any."""

import os
import re
import shutil
import subprocess
import sys

SKIPPED = 77  # ctest: the rule could not be checked here

FOLDERS = ["lattice", "skeleton", "fem", "adapt", "assets", "tools", "tests"]
TOP_LEVEL = set(FOLDERS) | {"LICENSE", "CHANGELOG.md", "README.md", "CMakeLists.txt", "CMakePresets.json"}

# Who may include whom, besides itself.
MAY_INCLUDE = {
    "lattice": set(),
    "skeleton": set(),
    "fem": {"lattice", "skeleton"},
    "adapt": {"lattice", "fem"},
    "assets": {"lattice", "skeleton"},
    "tools": {"lattice", "skeleton", "fem", "adapt", "assets"},
    "tests": set(FOLDERS),
}

# Rooms of a folder, from the bottom up: a room includes its own files and those of rooms below it. A room that is not
# named here, or a file that lies in none, is an offence, too.
ROOMS = {
    "fem": ["material", "linear", "body", "skin", "forces", "models", "report", "time"],
    "tools": ["support", "scene", "session", "ladder", "terminal", "commands", "shell", "measured", "make_samples",
              "cmake"],
}

# Code that serves programs of others, too: it neither reads flags nor writes to a terminal.
LIBRARY_ROOMS = {"support", "scene", "session", "ladder"}
TERMINAL = re.compile(r"std::c(?:out|err)\b|\bstd(?:out|err)\b")
FLAG = re.compile(r'"[^"]*(?<![\w-])--[a-z]')

# Programs that are one half of a folder's internals.
FRIENDS = {"tools/shell/import_main.cpp": "assets"}

# Headers of other libraries (a prefix) and the folders that may see them; tests may see all.
LIBRARIES = {
    "Eigen/": {"lattice", "skeleton", "fem", "adapt", "assets", "tools"},
    "unsupported/Eigen/": {"lattice", "skeleton", "fem", "adapt", "assets", "tools"},
    "tbb/": {"lattice", "fem", "adapt", "assets", "tools"},
    "oneapi/tbb": {"lattice", "fem", "adapt", "assets", "tools"},
    "fmt/": {"lattice", "skeleton", "fem", "adapt", "assets", "tools"},
    "CGAL/": {"lattice"},
    "nanoflann.hpp": {"lattice", "fem", "assets"},
    "cholmod": {"fem"},
    "omp.h": {"fem"},
    "embree3/": {"lattice", "assets"},
    "assimp/": {"assets"},
    "tiny_gltf.h": {"assets"},
    "urdf": {"assets"},
    "png.h": {"assets"},
    "zlib.h": {"assets"},
    "nlohmann/": {"assets", "tools"},
    "CLI/": {"tools"},
    "toml++/": {"tools"},
}
# What a public header of a library may show besides the standard library.
PUBLIC_LIBRARIES = ("Eigen/",)
FOREIGN_NAMES = re.compile(r"\b(cholmod_\w+|Assimp::|ai(Scene|Node|Mesh|Bone)\b|tinygltf::|urdf::|CGAL::|RTC\w+|tbb::)")

SYSTEM_HEADER = re.compile(
    r"((sys|linux|netinet|arpa)/\w+|unistd|fcntl|signal|dlfcn|poll|pthread|spawn|sched|errno|ftw|dirent|fenv|malloc|execinfo)\.h$")
STANDARD_HEADER = re.compile(r"[a-z_0-9]+$")
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')

# No paths of one machine, nothing left for later, no test that is switched off.
WORDS = {
    re.compile(r"(?<![\w.}])/(?:home|root|work|tmp|mnt|Users)/"): "a path of one machine",
    re.compile(r"\b(?:TO" r"DO|FIX" r"ME|XX" r"X)\b"): "work left for later",
    re.compile(r"\bGTEST_" r"SKIP\b|\bDISA" r"BLED_"): "a test that is switched off",
}

MAX_LINES = 600
MAX_FILE_BYTES = 1_000_000
MAX_SAMPLE_BYTES = 3_000_000
MAX_README_BYTES = 9_000
MAX_COLUMNS = 120

# The pages that list the sources which code and pages cite.
REFERENCES = ("lattice/METHOD.md", "fem/METHOD.md")
CITATION = re.compile(r"\[([A-Z][A-Za-z]+\d\d[a-z]?)(?=[\],;])")
LINK = re.compile(r"\]\(([^)\s#:]+)(?:#[^)\s]*)?\)")
TREE_PATH = re.compile(rf"(?<![\w/.-])((?:{'|'.join(FOLDERS)})/[\w./-]*\w)")


def tracked_files(root):
    """Paths of the tree relative to root: what git knows or would add; without git everything but build output."""
    listing = subprocess.run(
        ["git", "-C", root, "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=False) if shutil.which("git") else None
    if listing is not None and listing.returncode == 0:
        names = {name for name in listing.stdout.decode().split("\0") if name}
        return sorted(name for name in names if os.path.exists(os.path.join(root, name)))
    files = []
    for folder, subfolders, names in os.walk(root):
        if folder == root:
            subfolders[:] = [s for s in subfolders if s != ".git" and not s.startswith(("build", "out"))]
        files += [os.path.relpath(os.path.join(folder, name), root) for name in names]
    return sorted(files)


def read(root, name):
    with open(os.path.join(root, name), encoding="utf-8", errors="replace") as stream:
        return stream.read()


def sources(root):
    return [name for name in tracked_files(root) if name.endswith((".h", ".cpp"))]


def pages(root):
    return [name for name in tracked_files(root) if name.endswith(".md")]


def is_public_header(name):
    return name.endswith(".h") and name.split("/")[0] in FOLDERS[:5] and "/detail/" not in name


def check_layout(root):
    for name in tracked_files(root):
        top = name.split("/")[0]
        if top not in TOP_LEVEL and not top.startswith("."):
            yield f"{name}: the top level holds {', '.join(sorted(TOP_LEVEL))} only"


def check_own_include(root, name, line, included):
    folder, target = name.split("/")[0], included.split("/")[0]
    if target not in FOLDERS or not os.path.exists(os.path.join(root, included)):
        yield f"{name}:{line}: \"{included}\": includes start at the root of the tree"
    elif target != folder and target not in MAY_INCLUDE[folder]:
        allowed = ", ".join(sorted(MAY_INCLUDE[folder])) or "nobody else"
        yield f"{name}:{line}: \"{included}\": {folder} may include {allowed}"
    elif "/detail/" in included and target != folder and folder != "tests" and FRIENDS.get(name) != target:
        yield f"{name}:{line}: \"{included}\": internals of {target}"


def room_of(name):
    """The room of a file in a folder with rooms, None elsewhere; "" for a file that lies in no room."""
    parts = name.split("/")
    if parts[0] not in ROOMS:
        return None
    return parts[1] if len(parts) > 2 else ""


def check_room_include(name, line, included):
    folder, room, target = name.split("/")[0], room_of(name), room_of(included)
    if room is None or included.split("/")[0] != folder or {room, target} - set(ROOMS[folder]):
        return
    if ROOMS[folder].index(target) > ROOMS[folder].index(room):
        yield f"{name}:{line}: \"{included}\": room {room} lies below {target}"
    elif "/detail/" in included and target != room:
        yield f"{name}:{line}: \"{included}\": internals of {folder}/{target}"


def check_rooms(root):
    for name in sources(root):
        room = room_of(name)
        if room is not None and room not in ROOMS[name.split("/")[0]]:
            yield f"{name}: lies in none of the rooms {', '.join(ROOMS[name.split('/')[0]])}"
        for line, content in enumerate(read(root, name).splitlines(), 1):
            match = INCLUDE.match(content)
            if match and match.group(1) == '"':
                yield from check_room_include(name, line, match.group(2))


def check_terminal(root):
    """The terminal, its flags and their parser belong to the rooms of the command."""
    for name in sources(root):
        folder, room = name.split("/")[0], room_of(name)
        is_library = folder in FOLDERS[:5]
        if not is_library and not (folder == "tools" and room in LIBRARY_ROOMS):
            continue
        for line, content in enumerate(read(root, name).splitlines(), 1):
            code = content.split("//")[0]
            if is_library and FLAG.search(code):
                yield f"{name}:{line}: a flag; libraries name keys of a scene, in backquotes"
            if not is_library and (TERMINAL.search(code) or "<CLI/" in code):
                yield f"{name}:{line}: the terminal is the business of the command's rooms"


def check_library_include(root, name, line, included):
    folder = name.split("/")[0]
    if STANDARD_HEADER.match(included) or SYSTEM_HEADER.match(included):
        return
    if is_public_header(name) and not included.startswith(PUBLIC_LIBRARIES):
        yield f"{name}:{line}: <{included}>: a public header shows no library but Eigen"
    if folder == "tests":
        return
    folders = next((f for prefix, f in LIBRARIES.items() if included.startswith(prefix)), set())
    if folder not in folders:
        allowed = ", ".join(sorted(folders)) or "nobody (tests/checks/check_tree.py has the list)"
        yield f"{name}:{line}: <{included}>: this library belongs to {allowed}"


def check_includes(root):
    for name in sources(root):
        text = read(root, name)
        for line, content in enumerate(text.splitlines(), 1):
            match = INCLUDE.match(content)
            if not match:
                continue
            check = check_own_include if match.group(1) == '"' else check_library_include
            yield from check(root, name, line, match.group(2))
        if name.endswith(".h") and not re.search(r"^#pragma once$", text, re.MULTILINE):
            yield f"{name}: no #pragma once"
        if is_public_header(name) and FOREIGN_NAMES.search(text):
            yield f"{name}: {FOREIGN_NAMES.search(text).group(0)}: a public header shows no library but Eigen"


def check_words(root):
    for name in tracked_files(root):
        if name == "LICENSE" or not is_text(os.path.join(root, name)):
            continue
        for line, content in enumerate(read(root, name).splitlines(), 1):
            for pattern, what in WORDS.items():
                found = pattern.search(content)
                if found:
                    yield f"{name}:{line}: '{found.group(0)}': {what}"


def is_text(path):
    with open(path, "rb") as stream:
        return b"\0" not in stream.read(8192)


def check_sizes(root):
    samples = 0
    for name in tracked_files(root):
        size = os.path.getsize(os.path.join(root, name))
        if size > MAX_FILE_BYTES:
            yield f"{name}: {size} bytes, expected at most {MAX_FILE_BYTES}"
        if name.startswith("assets/samples/"):
            samples += size
        if name.endswith((".h", ".cpp")):
            text = read(root, name)
            lines = text.count("\n")
            if lines > MAX_LINES and not text.startswith("// Long, as "):
                yield f"{name}: {lines} lines, expected at most {MAX_LINES}, or '// Long, as ...' on the first line"
    if samples > MAX_SAMPLE_BYTES:
        yield f"assets/samples: {samples} bytes in all, expected at most {MAX_SAMPLE_BYTES}"
    yield from check_pages(root)


def prose_lines(text):
    """Numbered lines of a page without its code blocks, tables and lines with an address: what can be wrapped."""
    fenced = False
    for line, content in enumerate(text.splitlines(), 1):
        fence = content.startswith("```")
        fenced ^= fence
        if not (fenced or fence or content.startswith(("|", "    ")) or re.search(r"https?://", content)):
            yield line, content


def check_pages(root):
    """Sizes of what people read."""
    for name in pages(root):
        text = read(root, name)
        size = len(text.encode())
        if name == "README.md" and size > MAX_README_BYTES:
            yield f"{name}: {size} bytes, expected at most {MAX_README_BYTES}; pages in tools/manual hold the rest"
        for line, content in prose_lines(text):
            if len(content) > MAX_COLUMNS:
                yield f"{name}:{line}: {len(content)} columns, expected at most {MAX_COLUMNS}"


def check_references(root):
    """Every source that code and pages cite is listed, and every path that a page names is there."""
    names = pages(root)
    listed = {key for name in REFERENCES if name in names
              for key in re.findall(r"^- \[(\w+)\]", read(root, name), re.MULTILINE)}
    for name in [*sources(root), *names]:
        for line, content in enumerate(read(root, name).splitlines(), 1):
            for key in CITATION.findall(content):
                if key not in listed:
                    yield f"{name}:{line}: [{key}]: not among the references of {' and '.join(REFERENCES)}"
    for name in names:
        folder = os.path.dirname(name)
        for line, content in enumerate(read(root, name).splitlines(), 1):
            named = [(path, os.path.join(folder, path)) for path in LINK.findall(content)]
            named += [(path, path) for path in TREE_PATH.findall(LINK.sub("", content))]
            for path, place in named:
                if not os.path.exists(os.path.join(root, place)):
                    yield f"{name}:{line}: {path}: not there"


def check_format(root):
    tool = next((t for t in ("clang-format-14", "clang-format") if shutil.which(t)), None)
    version = subprocess.run([tool, "--version"], capture_output=True, text=True, check=True).stdout if tool else ""
    if "version 14." not in version:
        print("skipped: clang-format 14 is not installed (Debian package clang-format-14)")
        sys.exit(SKIPPED)
    names = sources(root)
    if not names:
        return
    report = subprocess.run([tool, "--dry-run", "--style=file", *names], cwd=root, capture_output=True, text=True,
                            check=False)
    for name in sorted(set(re.findall(r"^(\S+?):\d+:\d+: (?:warning|error):", report.stderr, re.MULTILINE))):
        yield f"{name}: not formatted; run {tool} -i {name}"


RULES = {"layout": check_layout, "includes": check_includes, "rooms": check_rooms, "terminal": check_terminal,
         "words": check_words, "sizes": check_sizes, "references": check_references, "format": check_format}


def main():
    if len(sys.argv) != 3 or sys.argv[2] not in RULES:
        print(f"usage: check_tree.py ROOT {'|'.join(RULES)}", file=sys.stderr)
        return 2
    offences = list(RULES[sys.argv[2]](sys.argv[1]))
    print("\n".join(offences) if offences else f"{sys.argv[2]}: nothing to complain about")
    return 1 if offences else 0


if __name__ == "__main__":
    sys.exit(main())
