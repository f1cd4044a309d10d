"""Valid content made hostile: bytes, text, trees of YAML and JSON, XML, headers of safetensors."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from random import Random
from typing import Any
from xml.etree import ElementTree

import yaml

CANARY = "fuzz-canary"  # file that hostile content asks a reader to make
MAX_CHANGES = 3
MAX_FLIPS = 16
DEEP = 20000  # brackets, more than any recursive reader bears

NUMBERS: tuple[Any, ...] = (
    *(0, -1, 1, 2, 2**31, -(2**31), 2**63, 2**64, 10**400),
    *(0.0, -0.0, 0.5, -1e-9, 1e-320, 1e38, 1e308, -1e308),
    *(float("nan"), float("inf"), -float("inf")),
)
TEXTS = (
    "",
    " ",
    "nan",
    "inf",
    "x",
    "../../../etc/passwd",
    "\u202e\U0001f4a3",
    "long " * 2000,
    "%s{0}",
)
OTHERS: tuple[Any, ...] = (
    None,
    True,
    False,
    [],
    {},
    [[]],
    [None],
    [float("nan")] * 3,
    [0.0] * 3,
    [0] * 1000,
)

# Texts in place of a value, or of the whole file.
YAML_BOMBS = (
    "[" * DEEP,
    "{a: " * 2000,
    "- " * 2000,
    "a: &a [" + "x, " * 9 + "x]\n"
    + "".join(
        f"{new}: &{new} [" + ", ".join([f"*{old}"] * 10) + "]\n"
        for old, new in zip("abcdefgh", "bcdefghi", strict=True)
    ),
    "&a [*a]",
    "&a {a: *a}",
    f"!!python/object/apply:pathlib.Path.touch [!!python/object:pathlib.Path {{}}, {CANARY}]",
    f"!!python/object/apply:os.system ['touch {CANARY}']",
    f"!!python/object/new:subprocess.check_output [['touch', '{CANARY}']]",
    "!!binary gIGC", "!!set {a, b}", "!!timestamp 2020-99-99", "2020-01-01", "2020-13-45",
    "1:30:00", "9" * 5000, "0x" + "f" * 5000, "1e999", ".nan", "*unknown", "? [a, b]\n: c",
    "<<: 3", "!unknown 3", "\"\\x00\"", "---\na: 1\n---\nb: 2", "%YAML 9.9", "\t- x",
)  # fmt: skip
JSON_BOMBS = (
    "[" * DEEP,
    '{"a":' * DEEP,
    "9" * 5000,
    "1e999",
    "NaN",
    "-Infinity",
    '"\\ud800"',
    "null",
    "[]",
    "3",
)
XML_BOMBS = (
    "<a>" * DEEP,
    '<!DOCTYPE r [<!ENTITY a "ha"><!ENTITY b "' + "&a;" * 10 + '"><!ENTITY c "' + "&b;" * 10
    + '"><!ENTITY d "' + "&c;" * 10 + '">]><robot name="&d;"/>',
    '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot name="x">&x;</robot>',
    "<robot/>", "<robot", "<html><body/></html>",
)  # fmt: skip

Mutation = Callable[[bytes, Random], bytes]


def change_bytes(content: bytes, random: Random) -> bytes:
    """Return bytes of which some are flipped, cut away, repeated or put in."""
    changed = bytearray(content)
    size = len(changed)
    at = random.randrange(size + 1)
    length = random.choice((1, 4, 8, 64, 4096))
    match random.randrange(8):
        case 0:
            return b""
        case 1:
            del changed[at:]
        case 2:
            del changed[at : at + length]
        case 3:
            changed[at:at] = random.randbytes(length)
        case 4:
            changed[at : at + length] = bytes(min(length, size - at))
        case 5:
            changed[at:at] = changed[at : at + length]
        case 6:
            changed[at : at + 4] = random.choice((b"\xff" * 4, b"\x7f\xff\xff\xff", b"\0\0\0\x80"))
        case _:
            for _ in range(random.randint(1, MAX_FLIPS) if size else 0):
                changed[random.randrange(size)] ^= 1 << random.randrange(8)
    return bytes(changed)


def change_yaml(content: bytes, random: Random) -> bytes:
    """Return a YAML file with hostile values, keys, structure or encoding."""
    if random.random() < 0.6:
        tree = change_tree(yaml.safe_load(content), random)
        return yaml.safe_dump(tree, allow_unicode=True, sort_keys=False).encode()
    return _change_text(content, YAML_BOMBS, random)


def change_json(content: bytes, random: Random) -> bytes:
    """Return a JSON file, or one of a line of JSON each, with hostile content."""
    if random.random() < 0.6:
        lines = content.splitlines() if content.count(b"\n{") else [content]
        line = random.randrange(len(lines))
        lines[line] = json.dumps(change_tree(json.loads(lines[line]), random)).encode()
        return b"\n".join(lines) + b"\n"
    return _change_text(content, JSON_BOMBS, random)


def change_xml(content: bytes, random: Random) -> bytes:
    """Return an XML file with hostile attributes or structure."""
    if random.random() < 0.3:
        return _change_text(content, XML_BOMBS, random)
    root = ElementTree.fromstring(content)
    for _ in range(random.randint(1, MAX_CHANGES)):
        elements = list(root.iter())
        element, other = random.choice(elements), random.choice(elements)
        values = [value for each in elements for value in each.attrib.values()]
        key = random.choice([*element.attrib, "name"])
        match random.randrange(5):
            case 0:
                element.attrib.pop(key, None)
            case 1:
                element.set(key, random.choice(values))
            case 2:
                hostile = random.choice((*NUMBERS, *TEXTS, "1 nan 1", "1 1", "1e999 0 0", "0 0 0"))
                element.set(key, _text(hostile))
            case 3:
                if other is not element and element not in other.iter():
                    other.append(copy.deepcopy(element))
            case _:
                for child in list(element)[: random.randint(1, 3)]:
                    element.remove(child)
    return ElementTree.tostring(root)


def change_safetensors(content: bytes, random: Random) -> bytes:
    """Return weights with hostile bytes, or with a header that is JSON still."""
    if random.random() < 0.4:
        return change_bytes(content, random)
    size = int.from_bytes(content[:8], "little")
    header, data = json.loads(content[8 : 8 + size]), content[8 + size :]
    told = header["__metadata__"]
    name = random.choice([*told, ""])
    if name:  # metadata are JSON in JSON
        told[name] = random.choice(
            (json.dumps(change_tree(json.loads(told[name]), random)), *JSON_BOMBS)
        )
    else:
        header = change_tree(header, random)
    text = json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + data


def change_tree(tree: Any, random: Random) -> Any:
    """Return a tree of mappings and lists in which some places hold something hostile."""
    tree = copy.deepcopy(tree)
    for _ in range(random.randint(1, MAX_CHANGES)):
        places = list(_places(tree))
        if not places:
            return _hostile(tree, random)
        holder, key = random.choice(places)
        match random.randrange(6):
            case 0:
                del holder[key]
            case 1:
                source, from_key = random.choice(places)
                if not isinstance(source, list) or from_key < len(source):
                    holder[key] = copy.deepcopy(source[from_key])
            case 2 if isinstance(holder, dict):
                holder[random.choice(("unknown", "", 3, None, "9" * 100))] = holder[key]
            case 2:
                holder.extend([copy.deepcopy(holder[key])] * random.choice((1, 100)))
            case _:
                holder[key] = _hostile(holder[key], random)
    return tree


def _hostile(value: Any, random: Random) -> Any:
    same_kind = NUMBERS if isinstance(value, int | float) else TEXTS
    if random.random() < 0.5:
        return random.choice(same_kind)
    deep: Any = value
    for _ in range(random.choice((1, 1, 50))):
        deep = [deep] if random.random() < 0.5 else {"a": deep}
    return random.choice((*NUMBERS, *TEXTS, *copy.deepcopy(OTHERS), deep))


def _places(tree: Any) -> list[tuple[Any, Any]]:
    """Return all places of a tree: what holds something, and its key or index there."""
    keys: Any = ()
    if isinstance(tree, dict):
        keys = list(tree)
    elif isinstance(tree, list):
        keys = range(len(tree))
    found = [(tree, key) for key in keys]
    return found + [place for key in keys for place in _places(tree[key])]


def _change_text(content: bytes, bombs: tuple[str, ...], random: Random) -> bytes:
    text = content.decode("utf-8")
    match random.randrange(6):
        case 0:
            return random.choice(bombs).encode()
        case 1:  # in place of a value
            lines = text.splitlines()
            line = random.randrange(len(lines))
            for mark in (": ", ":"):
                if mark in lines[line]:
                    lines[line] = lines[line].split(mark)[0] + mark + random.choice(bombs)
                    break
            return "\n".join(lines).encode()
        case 2:
            return text.encode(random.choice(("utf-16", "utf-32", "utf-8-sig", "utf-7")))
        case 3:
            at = random.randrange(len(text))
            return f"{text[:at]}{chr(random.randrange(1, 0xD800))}{text[at:]}".encode()
        case 4:
            lines = text.splitlines()
            random.shuffle(lines)
            return "\n".join(lines).encode()
        case _:
            return change_bytes(content, random)


def _text(value: Any) -> str:
    """Return what XML can hold of a value."""
    return str(value) if not isinstance(value, int) else f"{value:d}"
