"""`python -m splatbus_schemas.model`: prints the metamodel, for generators, as JSON."""

import json

from splatbus_schemas.model.metamodel import metamodel

if __name__ == "__main__":
    print(json.dumps(metamodel(), indent=1, ensure_ascii=False))
