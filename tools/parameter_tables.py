"""Write the nodes' parameters, and the keys of a model's file, into documents and JSON schema."""

import json
import re
from pathlib import Path

from kmn_perception.configuration.node_parameters import parameter_table
from kmn_perception.model.model_format import schema, tables

ROOT = Path(__file__).parents[1]
DOCUMENTS = {
    "docs/morph_node.md": "morph_node",
    "docs/simulation.md": "sim_node",
    "docs/skill.md": "skill_node",
    "docs/viewer.md": "viewer",
}
REFERENCE = "## All keys\n\n"  # the rest of docs/model_format.md is written here
TABLE = re.compile(r"^\| parameter \| type \|.*\n(?:\|.*\n)*", re.MULTILINE)


def main() -> None:
    """Replace the tables of each document, and the schema."""
    for document, node in DOCUMENTS.items():
        path = ROOT / document
        text = path.read_text(encoding="utf-8")
        before, after = TABLE.split(text)
        path.write_text(f"{before}{parameter_table(node)}\n{after}", encoding="utf-8")
    path = ROOT / "docs/model_format.md"
    before = path.read_text(encoding="utf-8").partition(REFERENCE)[0]
    path.write_text(f"{before}{REFERENCE}{tables()}", encoding="utf-8")
    path = ROOT / "config/models/model.schema.json"
    path.write_text(json.dumps(schema(), indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
