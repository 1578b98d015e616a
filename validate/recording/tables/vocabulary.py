"""Vocabulary of testing machines' exports in several languages.

Kept without accents and in lower case (`plain`): exports lose accents, and a text decoded with the
wrong table shows other letters. Chinese and Japanese words are looked for inside a text, the others
as whole words. The only place that knows words of columns, specimens and kinds of test.
"""

import re
import unicodedata
from collections.abc import Iterable
from functools import cache

_ROLES = {
    "stress": """stress spannung druckspannung zugspannung contrainte naprezenie esfuerzo sforzo
        tensao spanning drukspanning trekspanning napeti napatie feszultseg gerilme
        напряжение jannitys 应力 応力 응력""",
    "strain": """strain dehnung nominaldehnung odksztalcenie nyulas rek tojning unitaria
        unitario 应变 ひずみ 歪み 변형률""",
    "stretch": "stretch lambda λ streckung etirement",
    "time": """time t elapsed zeit prufzeit pruefzeit testzeit messzeit versuchszeit laufzeit dauer
        testtijd meettijd temps duree czas tiempo duracion tempo durata duracao cas ido tijd tid
        zaman sure aika timp время 时间 時間 시간""",
    "force": """force load f kraft standardkraft prufkraft pruefkraft druckkraft zugkraft last
        effort charge sila obciazenie fuerza carga forza carico forca zatizeni ero kracht
        drukkracht trekkracht belasting voima kuvvet yuk сила нагрузка усилие 力 载荷 负荷 荷重
        하중 시험력""",
    "displacement": """displacement disp compression extension crosshead position stroke travel
        deflection deformation closing indentation weg standardweg traversenweg traverse kolbenweg
        verformung stauchung verschiebung deplacement course allongement ecrasement enfoncement
        przemieszczenie droga wydluzenie skrocenie ugiecie deformacja desplazamiento recorrido
        deformacion compresion deslocamento deformacao spostamento corsa allungamento estensione
        deformazione draha posuv posunuti prodlouzeni stlaceni deformace elmozdulas distance
        erweiterung elongation alongamento extensao verlangerung verplaatsing indrukking
        vervorming verlenging forlangning forskjutning deformering forskydning forlaengelse
        forlengelse actuator langenanderung alargamiento uzama deplasman venyma siirtyma
        перемещение деформация удлинение 位移 变形 行程 変位 ストローク 伸び 변위
        distanza distancia afstand slag hub auslenkung durchbiegung doorbuiging fleche flecha
        freccia eindringtiefe eindrucktiefe eindringweg eindruckweg depth penetration profondeur
        profundidad profundidade profondita penetrazione penetracion penetracao indringing
        indringdiepte flyttning vandring 移動量 クロスヘッド 押込 压入 压痕深度 挠度 たわみ""",
}
_NOT_MEASURED = """max maximum maximal maximale maxi peak maksymalna maksymalne maximo maxima
    massimo massima command target setpoint sollwert consigne 最大 峰值"""
_SPEED = """rate speed velocity geschwindigkeit vitesse predkosc velocidad velocita rychlost
    velocidade 速度 速率"""
# Of the deformed body: stress on the area that is left, strain as a logarithm of the stretch.
TRUE = """true cauchy log logarithmic hencky wahre vraie reale verdadera verdadero verdadeira ware
    真"""
ENGINEERING = "engineering nominal nominale technische conventionnelle ingenieril 工程 公称"
_NOT = {
    "stress": TRUE + " rate yield",
    "strain": TRUE + " rate plastic",
    "stretch": "rate film",
    "time": "cycle date start step day clock datum 日期",
    "force": "temperature temperatur 温度",
    "displacement": "corrected korrigiert corrige",
}
# A word for a length that some machines write over a column of strain: the unit decides.
LENGTH_OR_STRAIN = """compression deformation verformung stauchung deformacja deformacion deformacao
    deformazione deformace compresion деформация 变形 extension elongation allongement allungamento
    alongamento extensao wydluzenie prodlouzeni vervorming verlenging forlangning deformering
    verlangerung alargamiento uzama venyma удлинение 伸び"""
SIZES = {
    "diameter": """diameter durchmesser probendurchmesser diametre srednica diametro prumer atmero
        диаметр halkaisija cap 直径""",
    "height": """height hohe hoehe probenhohe hauteur wysokosc altura altezza vyska magassag высота
        hoogte hojd hojde hoyde korkeus yukseklik 高度 高さ""",
    "width": """width breite probenbreite largeur szerokosc anchura ancho larghezza largura sirka
        ширина
        breedte bredd bredde leveys genislik 宽度 幅""",
    "thickness": """thickness dicke probendicke epaisseur grubosc espesor spessore espessura
        tloustka толщина
        dikte tjocklek tykkelse tykkelsen paksuus kalinlik 厚度 厚さ 厚み""",
    "length": """length lange laenge probenlange longueur dlugosc longitud lunghezza comprimento
        delka длина
        lengte langd laengde lengde pituus uzunluk einspannlange messlange klemmlange anfangslange
        长度 标距 長さ 標線間距離""",
    "area": """area flache querschnitt querschnittsflache superficie powierzchnia plocha section
        seccion sezione seccao aire oppervlakte doorsnede areal tvarsnitt 面积 断面積""",
    "speed": _SPEED + " prufgeschwindigkeit pruefgeschwindigkeit testgeschwindigkeit",
}
OTHER_PARTS = """platen plate anvil probe plunger indenter grip final cell stempel druckplatte
    druckplatten plateau plytka piston 压盘 压头"""
# Beginnings of words, so that inflected and compound ones count: `Zugversuchs`, `сжатия`. Bare
# `Druck`, `tlak` (pressure) and `extension` (the crosshead's way in any test) are not among them.
COMPRESSION = """compress compresion compresiv closing druckversuch druckpruf druckpruef druckkraft
    druckspannung druckfestigkeit druckbelast druckmodul druckverform stauch ecrasement sciska
    skrocen tlakem tlakov stlacen nyomo сжати сжима сжимающ drukproef drukkracht puristuskoe basma
    sikistirma sıkıstırma 压缩 抗压 壓縮 圧縮 압축"""
TENSION = """tensil tension traction tracci trazion tracao tracoes zugversuch zugpruf zugpruef
    zugkraft zugspannung zugfestigkeit zugbelast zugmodul zugdehnung zugverform rozciag tahem tahov
    huzo szakito растяж растягив trekproef trekkracht dragprov vetokoe cekme 拉伸 抗拉 引張 引っ張
    인장"""
# Of neither test: what a specimen is loaded with before it, and the air that shuts a grip.
_NO_KIND = re.compile(
    r"pre[-_ ]?(tension|compression)\w*|surface tension|(compressed|сжат\w+) (air|воздух)\w*"
    r"|compressor\w*|aria compressa|data compression"
)
# Keys of what is beside the test: material, machine, its parts, people, remarks, files.
BESIDE_THE_TEST = """material materia werkstoff cell messdose aufnehmer capteur sensor cella celula
    transducer fixture grip clamp platen plate jaw einspann mors garra mordaza company firm societe
    empresa azienda customer client kunde lab operator user bediener prufer operateur comment note
    remark bemerk komment observ file path datei fichier archiv machine maschine macchina maquina
    serial instrument frame prepar 材料 传感器 夹具 公司 备注 操作"""
STOPPED = """aborted cancelled canceled interrupted abgebrochen interrompu interrotto interrotta
    interrumpido interrumpida abortado abortada interrompido прерван прервано przerwano przerwane
    preruseno megszakitva afgebroken avbruten avbrutet afbrudt 中止 中断"""
_BY_HAND = re.compile(r"\b(stopped|ended|terminated) by (the )?(operator|user)\b")
NEGATED = "no false none nein non nie нет off 否"
SPECIMEN = """specimen sample test probe prufling eprouvette echantillon essai probka probeta
    muestra provino campione vzorek amostra proba образец 试样 试件 样品 試験片"""
UNIT_LABELS = "unit units einheit einheiten unite unites jednostka unidad unita jednotka 单位 単位"
_ENCODING_EVIDENCE = """druckprufung zugprufung ecrasement sciskanie sciskania rozciaganie
    rozciagania compresion compressao traccion tracao tlakova tahova nyomovizsgalat сжатие сжатия
    растяжение растяжения
    prufung prufer prufnorm prufen fur operateur numero prenom annee ecole
    uzytkownik data badania badanie operator wykonal nazwa probki wartosc modul dlugosci zkouska
    cislo rychlosti merici rozmery zeleznicni ubytek vzorku numer naprezenia predkosci metoda
    编号 单位 日期 试验 试样 实验 样品 名称 材料 压缩 操作 测试 単位 試験 試験力 名前 日付
    дата образца оператор испытание"""


def plain(text: str) -> str:
    """Lower case without accents: `Prüfkraft` -> `prufkraft`, `Siła` -> `sila`."""
    spread = unicodedata.normalize(
        "NFKD", text.casefold().translate({0x142: "l", 0xF8: "o", 0xE6: "ae"})
    )
    return "".join(c for c in spread if not unicodedata.combining(c))


def words(text: str) -> frozenset[str]:
    """Return the words of a text, plain."""
    return frozenset(re.findall(r"[^\W\d_]+", plain(text)))


@cache
def terms(text: str) -> frozenset[str]:
    """Return the plain words of a vocabulary entry."""
    return frozenset(plain(word) for word in text.split())


def holds(text: str, vocabulary: str) -> bool:
    """Return whether one of the vocabulary's words is in the text."""
    wanted = terms(vocabulary)
    inside = plain(text)
    return bool(words(text) & wanted) or any(w in inside for w in wanted if is_ideographic(w))


def kind_word(text: str, kind: str) -> str | None:
    """Return the first word that begins as one of a kind's does, plain; an ideographic one
    anywhere."""
    inside = _NO_KIND.sub(" ", " ".join(text.casefold().split()))
    stems = tuple(terms(kind))
    first = (w for w in re.findall(r"[^\W\d_]+", plain(inside)) if w.startswith(stems))
    whole = (w for w in sorted(stems) if is_ideographic(w) and w in plain(inside))
    return next(first, None) or next(whole, None)


def tells_a_stop(text: str) -> bool:
    """Return whether it says that a test was ended before its end."""
    if holds(text, NEGATED) or re.search(r"[:=]\s*0\b", text):
        return False
    return holds(text, STOPPED) or bool(_BY_HAND.search(plain(text)))


def is_ideographic(word: str) -> bool:
    return ord(word[0]) >= 0x2E80


def role_of_name(name: str) -> str | None:
    """Return the role that a column's name gives it, None for a column of no interest here.

    A column has a role when its name holds one of the role's words and none of the words that make
    it something else; roles are tried from the top.
    """
    for role, given in _ROLES.items():
        if holds(name, given):
            taken = f"{_NOT[role]} {_NOT_MEASURED} {'' if role == 'time' else _SPEED}"
            return None if holds(name, taken) else role
    return None


def of_the_deformed(name: str) -> str:
    """Return a name without the words that say true stress or strain."""
    return " ".join(w for w in re.findall(r"[^\W\d_]+", plain(name)) if w not in terms(TRUE))


@cache
def evidence() -> frozenset[str]:
    """Every word of two letters or more that can tell encodings apart."""
    texts: Iterable[str] = (
        *_ROLES.values(), *SIZES.values(), COMPRESSION, TENSION, SPECIMEN, UNIT_LABELS,
        _NOT_MEASURED, _ENCODING_EVIDENCE,
    )  # fmt: skip
    return frozenset(w for text in texts for w in terms(text) if len(w) > 1)
