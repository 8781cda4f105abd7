"""Formats for export of results: one per file of this folder; other packages can add more.

A format is a module with

    SUMMARY   its kind and its readers, in one line
    ENDINGS   of files, such as (".mat",)
    WRITERS   by the kind of a result (the attribute `kind` of its file; ANY: every kind) a function
              write(record, path, **options) that writes a file, from a studies.export.record.ExportRecord, by
              files.store.replacing. It may return warnings: data that the file does not hold
    OPTIONS   the keyword arguments of its writers, as studies.export.export.Option

Import heavy modules inside the writers: `vanedamp export --help` loads all formats.
"""
