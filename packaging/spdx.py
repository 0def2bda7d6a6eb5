#!/usr/bin/env python3
"""Writes an SPDX 2.3 list, FILE.spdx.json, for each package and archive of a folder: its files with
their sums, what was compiled into it, and what it depends on.

usage: spdx.py --commit COMMIT --epoch SECONDS FOLDER

FOLDER/components.txt, which packaging/build_debs writes and this program removes, has the versions
of the header libraries that are compiled in.
"""

import argparse
import datetime
import hashlib
import io
import json
import pathlib
import re
import subprocess
import tarfile
import uuid
import zipfile

NO = "NOASSERTION"
COPYRIGHT = re.search(r"Copyright \(c\) (.*)", (pathlib.Path(__file__).resolve().parents[1] /
                                               "LICENSE").read_text()).group(1)
HOLDER = COPYRIGHT.split(", ", 1)[1]
# Header libraries: the package with their version (Debian's, or PyPI's for MAVLink, whose headers
# pymavlink generates), name, licence, and which artefacts contain their code.
COMPONENTS = {
    "libeigen3-dev": ("Eigen", "MPL-2.0", r"libtwoview0|libtwoview-dev|\.whl$"),
    "libcli11-dev": ("CLI11", "BSD-3-Clause", r"^twoview_.*deb$"),
    "nlohmann-json3-dev": ("nlohmann-json", "MIT", r"^twoview_.*deb$"),
    "pymavlink": ("MAVLink", "MIT", r"^(libtwoview-drivers0|libtwoview-dev|twoview_).*deb$"),
}


def archive_files(archive):
    for entry in archive:
        if entry.isfile():
            yield entry.name.removeprefix("./"), archive.extractfile(entry).read()


def files_of(path):
    """(name, bytes) of each regular file in a package or an archive."""
    if path.suffix == ".deb":
        plain = subprocess.run(["dpkg-deb", "--fsys-tarfile", path], check=True,
                               stdout=subprocess.PIPE).stdout
        yield from archive_files(tarfile.open(fileobj=io.BytesIO(plain)))
    elif path.suffix == ".whl":
        with zipfile.ZipFile(path) as archive:
            for name in archive.namelist():
                yield name, archive.read(name)
    else:
        with tarfile.open(path) as archive:
            yield from archive_files(archive)


def depends_of(path, contents):
    """The names and bounds of the packages that this one needs at run time."""
    if path.suffix == ".deb":
        text = subprocess.run(["dpkg-deb", "--field", path, "Depends"], check=True,
                              capture_output=True, text=True).stdout
        return [part.strip() for part in text.replace("\n", " ").split(",") if part.strip()]
    if path.suffix == ".whl":
        text = next(data for name, data in contents if name.endswith(".dist-info/METADATA"))
        return re.findall(r"(?m)^Requires-Dist: (.*?)\r?$", text.decode())
    return []


def sums(data, *kinds):
    return [{"algorithm": kind.upper(), "checksumValue": hashlib.new(kind, data).hexdigest()}
            for kind in kinds]


def package(identity, name, version, licence, **more):
    return {"SPDXID": identity, "name": name, "versionInfo": version, "downloadLocation": NO,
            "licenseConcluded": licence, "licenseDeclared": licence, "copyrightText": NO,
            "filesAnalyzed": False, **more}


def document(path, components, commit, created):
    data = path.read_bytes()
    contents = sorted(files_of(path))
    files = [{"SPDXID": f"SPDXRef-File-{number}", "fileName": f"./{name}",
              "checksums": sums(content, "sha1", "sha256"), "licenseConcluded": NO,
              "licenseInfoInFiles": [NO], "copyrightText": NO}
             for number, (name, content) in enumerate(contents)]
    code = hashlib.sha1("".join(sorted(f["checksums"][0]["checksumValue"] for f in files))
                        .encode()).hexdigest()
    own = package("SPDXRef-Package", path.name, commit, "BSD-3-Clause", packageFileName=path.name,
                  checksums=sums(data, "sha256"), filesAnalyzed=True,
                  copyrightText=COPYRIGHT, licenseInfoFromFiles=[NO],
                  packageVerificationCode={"packageVerificationCodeValue": code},
                  hasFiles=[f["SPDXID"] for f in files])
    packages = [own]
    relations = [("SPDXRef-DOCUMENT", "DESCRIBES", "SPDXRef-Package")]
    for source, (name, licence, where) in COMPONENTS.items():
        if re.search(where, path.name):
            identity = f"SPDXRef-Component-{name}"
            packages.append(package(identity, name, components.get(source, NO), licence))
            relations.append(("SPDXRef-Package", "STATIC_LINK", identity))
    for number, needed in enumerate(depends_of(path, contents)):
        identity = f"SPDXRef-Dependency-{number}"
        packages.append(package(identity, needed, NO, NO))
        relations.append(("SPDXRef-Package", "DEPENDS_ON", identity))
    namespace = uuid.uuid5(uuid.NAMESPACE_OID, hashlib.sha256(data).hexdigest())
    return {
        "spdxVersion": "SPDX-2.3", "dataLicense": "CC0-1.0", "SPDXID": "SPDXRef-DOCUMENT",
        "name": path.name, "documentNamespace": f"urn:uuid:{namespace}",
        "creationInfo": {"created": created,
                         "creators": [f"Organization: {HOLDER}", "Tool: packaging/spdx.py"]},
        "packages": packages, "files": files,
        "relationships": [{"spdxElementId": a, "relationshipType": kind, "relatedSpdxElement": b}
                          for a, kind, b in relations],
    }


def main():
    parser = argparse.ArgumentParser(description="SPDX lists of a release's files")
    parser.add_argument("--commit", required=True)
    parser.add_argument("--epoch", type=int, required=True)
    parser.add_argument("folder", type=pathlib.Path)
    arguments = parser.parse_args()
    created = datetime.datetime.fromtimestamp(arguments.epoch, datetime.timezone.utc)
    versions = arguments.folder / "components.txt"
    components = {}
    if versions.exists():
        components = dict(line.split() for line in versions.read_text().splitlines())
        versions.unlink()
    for path in sorted(arguments.folder.iterdir()):
        if path.suffix in (".deb", ".whl", ".gz", ".xz"):
            made = document(path, components, arguments.commit,
                            created.strftime("%Y-%m-%dT%H:%M:%SZ"))
            text = json.dumps(made, indent=1, ensure_ascii=False) + "\n"
            (arguments.folder / f"{path.name}.spdx.json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
