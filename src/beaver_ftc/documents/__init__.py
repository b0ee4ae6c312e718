"""Files and their mistakes: from third-party YAML text to checked data, where files lie, errors in words."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.documents.document import (
        Conflict,
        Document,
        Location,
        Number,
        Problem,
        Section,
        Whole,
        deny,
        entry,
        number,
        refuse,
    )
    from beaver_ftc.documents.document import parse as parse_yaml
    from beaver_ftc.documents.errors import BadInput, BeaverFtcError, SimulationFailed, suggestion
    from beaver_ftc.documents.files import cache_base, inside, put_folder, read_json
    from beaver_ftc.documents.report import ScenarioError
    from beaver_ftc.documents.validation import parse_document, read_file, text_of
    from beaver_ftc.documents.validation import validate as validate_model
else:
    __getattr__, __dir__ = lazily(__name__)
