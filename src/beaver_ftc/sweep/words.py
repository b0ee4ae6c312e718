def summary_text(d, colour=False):
    import json

    return json.dumps(d, indent=1)
