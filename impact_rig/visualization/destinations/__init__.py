"""Where the view goes: files, viewers here and elsewhere, a web page."""
