"""Write the parameters of the nodes into the tables of the documents, see `parameter_table`."""

import re
from pathlib import Path

from kmn_perception.configuration.node_parameters import parameter_table

ROOT = Path(__file__).parents[1]
DOCUMENTS = {
    "README.md": "morph_node",
    "docs/simulation.md": "sim_node",
    "docs/skill.md": "skill_node",
}
TABLE = re.compile(r"^\| parameter \| type \|.*\n(?:\|.*\n)*", re.MULTILINE)


def main() -> None:
    """Replace the table of each document."""
    for document, node in DOCUMENTS.items():
        path = ROOT / document
        text = path.read_text(encoding="utf-8")
        before, after = TABLE.split(text)
        path.write_text(f"{before}{parameter_table(node)}\n{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
