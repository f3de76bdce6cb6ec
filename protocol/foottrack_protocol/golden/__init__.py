"""The golden messages in ``vectors/``, which every client decodes in its tests."""
