"""The functions behind `import vbaa_bench`, which the command line calls as well."""
