"""Reports for CI: SARIF, JUnit and annotations of GitHub, of checks, comparisons and scripts."""
