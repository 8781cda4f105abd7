"""The sections of the report: each file here shows one kind of result, and other packages add theirs.

A section is a module with

    KIND                    of result: the attribute `kind` of an HDF5 file, or the ending of a file (".claims.json")
    load(path)              read a file; returns a studies.report.results.Result
    section(results, page)  return the template's data; results: of the kind, by the path of their file, page:
                            a studies.report.page.Page, which makes the charts
    ORDER                   place on the page

and with it a Jinja template of the same name, such as sweep.html for sweep.py. It is given `section`, and the name of
the `study` that the results belong to, if any, and its `title`. It has the macro `plot(chart)` and, for files, the
filters `name` and `anchor`. What it writes inside `{% call later() %}` stands in the section of the energies,
and inside `{% call strength() %}` in that of strength and life.
"""
