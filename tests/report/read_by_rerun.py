"""What Rerun finds in an MCAP file, as JSON: by topic its components, rows and first row.

Usage: python read_by_rerun.py FILE. Run apart: its library brings threads of its own.
"""

import json
import sys
from typing import Any

from rerun.chunk import McapReader


def main(path: str) -> None:
    found: dict[str, dict[str, Any]] = {}
    for chunk in McapReader(path).stream():
        batch = chunk.to_record_batch()
        at = found.setdefault(chunk.entity_path, {"rows": {}, "first": {}})
        for name in batch.schema.names:
            if ":" not in name or name.startswith("Mcap"):
                continue
            at["rows"][name] = at["rows"].get(name, 0) + batch.num_rows
            at["first"].setdefault(name, batch.column(name)[0].as_py())
    print(json.dumps(found, default=repr))


main(sys.argv[1])
