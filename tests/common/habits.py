"""Habits that cost a reader time, counted in the product: `python -m tests.common.habits`.

A place is counted by its syntax alone, so that the rule is the same for everybody.
"""

from __future__ import annotations

import ast
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).parents[2]
PRODUCT = ("simbench", "detectors", "scenarios")

Trees = Mapping[str, ast.Module]


def product_trees() -> dict[str, ast.Module]:
    """Return the syntax tree of every file of the product by its path."""
    files = sorted(p for name in PRODUCT for p in (ROOT / name).rglob("*.py"))
    return {p.relative_to(ROOT).as_posix(): ast.parse(p.read_text("utf-8")) for p in files}


def packed(tree: ast.Module) -> Iterator[ast.stmt]:
    """Yield the statements that state several facts: names that are unpacked from a tuple written
    out, a generator, a `map` or a conditional. A swap states one.
    """
    for node in ast.walk(tree):
        if not (isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Tuple)):
            continue
        names = {ast.unparse(name) for name in node.targets[0].elts}
        match node.value:
            case ast.Tuple(elts=values) if {ast.unparse(x) for x in values} != names:
                yield node
            case ast.GeneratorExp() | ast.ListComp() | ast.IfExp():
                yield node
            case ast.Call(func=ast.Name(id="map")):
                yield node


def mistyped(tree: ast.Module) -> Iterator[ast.stmt]:
    """Yield the functions that say "Return whether" and return no truth value, and those that
    return an object or, as a bare string, why there is none.
    """
    for node in ast.walk(tree):
        if not isinstance(node, ast.FunctionDef) or node.returns is None:
            continue
        answer = ast.unparse(node.returns)
        says = (ast.get_docstring(node) or "").startswith(("Return whether", "Whether"))
        if (says and not answer.startswith(("bool", "np.ndarray", "tuple"))) or _or_text(answer):
            yield node


def _or_text(answer: str) -> bool:
    """Return whether an annotation is a class of the product or a string."""
    forms = answer.split(" | ")
    classes = [form for form in forms if form[:1].isupper() and form.isalpha() and form != "None"]
    return "str" in forms and bool(classes)


def edited_as_tables(tree: ast.Module) -> Iterator[ast.stmt]:
    """Yield the functions in which a loop becomes a table and a table a loop."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            called = {
                call.func.attr
                for call in ast.walk(node)
                if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute)
            }
            if {"to_table", "from_table"} <= called:
                yield node


HABITS: dict[str, Callable[[ast.Module], Iterator[ast.stmt]]] = {
    "several facts in one statement": packed,
    "a type hidden in a string": mistyped,
    "a loop edited as a table": edited_as_tables,
}


def places(habit: str, trees: Trees) -> list[str]:
    """Return file and line of every place with a habit."""
    found = HABITS[habit]
    return [f"{name}:{node.lineno}" for name, tree in trees.items() for node in found(tree)]


def statements(trees: Trees) -> int:
    """Return the number of statements."""
    return sum(isinstance(node, ast.stmt) for tree in trees.values() for node in ast.walk(tree))


# per 1000 statements
MOST: dict[str, tuple[tuple[type[ast.AST], ...], float]] = {
    "conditional expressions": ((ast.IfExp,), 25.0),
    "comprehensions": ((ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp), 35.0),
    "starred": ((ast.Starred,), 10.0),
}
# shares of functions
MOST_BARE = 0.15  # of those whose body has 15 lines and more: no blank line, no comment
MOST_OF_ONE_WORD = 0.15  # of private ones
LONG = 15  # lines of a body


def counted(trees: Trees) -> dict[str, float]:
    """Return how often each habit of `MOST` occurs per 1000 statements, and the two shares."""
    total = max(statements(trees), 1)
    found: Counter[str] = Counter()
    for tree in trees.values():
        for node in ast.walk(tree):
            for habit, (kinds, _) in MOST.items():
                found[habit] += isinstance(node, kinds)
    numbers = {habit: 1000 * found[habit] / total for habit in MOST}
    long = []
    private = []
    for name, tree in trees.items():
        lines = (ROOT / name).read_text("utf-8").splitlines()
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef):
                private += [node.name] if is_private(node.name) else []
                long += [has_paragraphs(node, lines)] if length_of(node) >= LONG else []
    one_word = [name for name in private if "_" not in name.strip("_")]
    numbers["bare"] = 1 - sum(long) / max(len(long), 1)
    numbers["one word"] = len(one_word) / max(len(private), 1)
    return numbers


def is_private(name: str) -> bool:
    """Return whether a name begins with one underscore."""
    return name.startswith("_") and not name.startswith("__")


def body_of(node: ast.FunctionDef) -> list[ast.stmt]:
    """Return the statements of a function without its docstring."""
    return node.body[1:] if ast.get_docstring(node) is not None else node.body


def length_of(node: ast.FunctionDef) -> int:
    """Return the number of lines of a function's body without its docstring."""
    body = body_of(node)
    return body[-1].end_lineno - body[0].lineno + 1 if body else 0


def has_paragraphs(node: ast.FunctionDef, lines: Sequence[str]) -> bool:
    """Return whether a blank line or a comment stands in a function's body, or above its first
    statement.
    """
    first = body_of(node)[0].lineno - 1
    while first > node.lineno and lines[first - 1].strip().startswith(("#", "@")):
        first -= 1
    inside = [line.strip() for line in lines[first : node.end_lineno]]
    return any(not line or line.startswith("#") for line in inside)


def rooms_of(trees: Trees) -> dict[str, Trees]:
    """Return the trees of each room, and of all of them."""
    rooms: dict[str, dict[str, ast.Module]] = {}
    for name, tree in trees.items():
        rooms.setdefault("/".join(name.split("/")[:2]).removesuffix(".py"), {})[name] = tree
    folders = {room: own for room, own in rooms.items() if (ROOT / room).is_dir()}
    return folders | {"all": trees}


def main() -> None:
    """Print the counts, by room and in the whole, and with a word of a habit its places."""
    trees = product_trees()
    total = statements(trees)
    for habit in HABITS:
        found = places(habit, trees)
        print(f"{habit}: {len(found)}, {1000 * len(found) / total:.1f} per 1000 statements")
        if any(word in habit for word in sys.argv[1:]):
            print(*(f"  {place}" for place in found), sep="\n")
    print("\nper 1000 statements, and shares of functions:")
    for room, own in rooms_of(trees).items():
        numbers = counted(own)
        told = [f"{habit} {numbers[habit]:.0f}" for habit in MOST]
        told += [f"bare {numbers['bare']:.0%}", f"one word {numbers['one word']:.0%}"]
        print(f"{room:20s} {', '.join(told)}")


if __name__ == "__main__":
    main()
