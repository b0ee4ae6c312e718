"""Marks of the pages: what differs from what is printed is named, and written."""

import json

from tools.docs.commands import Output
from tools.docs.marks import parsed
from tools.docs.refresh import Refreshed, Wanted

PAGE = """# A page

<!-- printed: fly one -->
```text
detected after 0.02 s
```
<!-- /printed -->

<!-- from flown: fly two --format json -->
It takes <!--=flown rows.1.delay_s .2f-->0.30<!--/--> s in <!--=flown share *100 .0f-->40<!--/--> %.

```html
<!-- printed: nothing, this is an example -->
```
"""
PRINTED = {
    "fly one": Output("detected after 0.02 s"),
    "fly two --format json": Output(json.dumps({"rows": [{}, {"delay_s": 0.3}], "share": 0.4})),
}


def test_what_differs_is_named_with_line_both_texts_and_command_and_is_written():
    stale = PAGE.replace("0.02 s", "0.01 s").replace("0.30<", "0.29<")
    made = Refreshed(parsed(stale, "docs/page.md"), PRINTED, Wanted(probes=True))
    assert list(map(str, made.changes)) == [
        'docs/page.md:5: stands "detected after 0.01 s", printed "detected after 0.02 s" by fly one',
        'docs/page.md:10: stands "0.29", printed "0.30" by flown rows.1.delay_s of fly two --format json',
    ]
    assert made.text == PAGE
